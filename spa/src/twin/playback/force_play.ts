import type { Schema } from '@posecast/wire';
import type { FootWrench } from '../balance/standing.ts';
import { ValueLimits } from '../limits/limits.ts';
import type { Vec3 } from '../rotation.ts';
import { WrenchTable } from '../sensors/wrenches.ts';

/** Numbers of one sensor: force and moment. */
const SIZE = 6;

/** The values of force-torque sensors as numbers that can be played with the pose. */
export class ForcePlay {
  readonly #table: WrenchTable;
  readonly #limits: ValueLimits;
  /** For each sensor, whether its force and its moment had a reading in the newest frame: without one, playback stops. */
  readonly #isRead: [force: boolean, moment: boolean][];

  constructor(schema: Schema) {
    this.#table = new WrenchTable(schema);
    this.#limits = new ValueLimits(schema.mapping);
    this.#isRead = this.#table.wrenches.map(() => [false, false]);
  }

  /** How many numbers there are. */
  get size(): number {
    return this.#table.wrenches.length * SIZE;
  }

  /** Writes a frame's numbers; NaN without a reading. */
  read(codes: Int32Array, into: Float64Array): void {
    this.#table.read(codes, this.#limits).forEach(({ force, moment }, i) => {
      into.set(force.vector ?? NONE, i * SIZE);
      into.set(moment.vector ?? NONE, i * SIZE + 3);
      this.#isRead[i] = [force.vector !== null, moment.vector !== null];
    });
  }

  /** The wrenches for played numbers, in their channels' units. */
  of(numbers: Float64Array): FootWrench[] {
    const at = (i: number): Vec3 => [numbers[i]!, numbers[i + 1]!, numbers[i + 2]!];
    return this.#table.wrenches.map(({ site, force, moment }, i) => {
      const [hasForce, hasMoment] = this.#isRead[i]!;
      return {
        site,
        force: { vector: hasForce ? at(i * SIZE) : null, axes: force.axes },
        moment: { vector: hasMoment ? at(i * SIZE + 3) : null, axes: moment.axes },
      };
    });
  }
}

const NONE = [Number.NaN, Number.NaN, Number.NaN];
