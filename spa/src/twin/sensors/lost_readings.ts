import { MISSING, type Schema } from '@posecast/wire';

/** Finds joints that have lost their reading. A joint that never had one is left out: the table shows that it has none. */
export class LostReadings {
  readonly #schema: Schema;
  readonly #read = new Set<string>();

  constructor(schema: Schema) {
    this.#schema = schema;
  }

  /** The joints, by the robot's names, whose position was read before and is missing in these codes. */
  update(codes: Int32Array): string[] {
    const pos = this.#schema.field('pos');
    const lost: string[] = [];
    pos?.labels.forEach((joint, i) => {
      if (codes[pos.start + i] !== MISSING) this.#read.add(joint);
      else if (this.#read.has(joint)) lost.push(joint);
    });
    return lost;
  }
}
