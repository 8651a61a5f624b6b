import type { Vec3 } from '../twin/rotation.ts';
import { layOutRow, type RowItem } from './row_layout.ts';

/** Along the world's axes, metres. */
export interface Box {
  readonly min: Vec3;
  readonly max: Vec3;
}

/** A robot that stands in a row, with a body or without one yet. */
export interface RowNode extends RowItem {
  readonly figure: {
    readonly root: { readonly matrixWorld: { readonly elements: ArrayLike<number> } };
  } | null;
  /** Where it looks, rad from the world's x. */
  readonly heading: number;
  /** The world's box around it; null while there is no model. */
  box(): Box | null;
  dispose(): void;
}

/** The robots of one picture, side by side. The first is the one that the picture is of; others may stand beside it. */
export class RobotRow<N extends RowNode> {
  readonly #robots: N[] = [];

  /** All of them, the first at the right of the picture from the front. */
  get robots(): readonly N[] {
    return this.#robots;
  }

  get several(): boolean {
    return this.#robots.length > 1;
  }

  /** Where they look, rad from the world's x; several look nowhere together: 0. */
  get heading(): number {
    return this.several ? 0 : (this.#robots[0]?.heading ?? 0);
  }

  add(robot: N): void {
    this.#robots.push(robot);
  }

  /** Makes room for each. Returns what they fill together; null without a model. */
  arrange(): Box | null {
    if (this.several) layOutRow(this.#robots);
    const boxes = this.#robots.flatMap((robot) => robot.box() ?? []);
    if (boxes.length === 0) return null;
    const far = (corner: 'min' | 'max', axis: 0 | 1 | 2) =>
      Math[corner](...boxes.map((box) => box[corner][axis]));
    const corner = (of: 'min' | 'max'): Vec3 => [far(of, 0), far(of, 1), far(of, 2)];
    return { min: corner('min'), max: corner('max') };
  }

  /** The middle of where they stand; null without a model. */
  middle(): { readonly x: number; readonly y: number } | null {
    const roots = this.#robots.flatMap(({ figure }) => figure?.root.matrixWorld ?? []);
    if (roots.length === 0) return null;
    const mean = (at: number) => roots.reduce((sum, { elements }) => sum + elements[at]!, 0) / roots.length;
    return { x: mean(12), y: mean(13) };
  }

  dispose(): void {
    for (const robot of this.#robots) robot.dispose();
  }
}

/** The middle of a robot's upper side; null while it has no body. */
export function topOf(robot: RowNode): Vec3 | null {
  const box = robot.box();
  if (box === null) return null;
  const { min, max } = box;
  return [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, max[2]];
}
