import type { PlacedBox } from '../../model/posed_body.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { type BodySpan, spanOf } from '../camera/whole_body.ts';

/** Minimum room for a robot, also while it has no model, metres. */
const LEAST_ROOM = 0.3;
/** Room for a robot as a multiple of its width (for its arms) and of its height (for its name); the larger counts. */
const WIDTHS = 1.3;
const HEIGHTS = 0.6;

/** A robot that can stand in a row. */
interface RowItem {
  /** Size along the world's axes, metres; null while there is no model. */
  readonly size: readonly [x: number, y: number, z: number] | null;
  /** Moves its whole world along the scene's y, metres. */
  standAside(y: number): void;
}

/** Puts robots side by side along y, with the middle of the row at the origin. */
export function layOutRow(robots: readonly RowItem[]): void {
  const rooms = robots.map(({ size }) =>
    size === null ? LEAST_ROOM : Math.max(LEAST_ROOM, size[1] * WIDTHS, size[2] * HEIGHTS),
  );
  let y = -rooms.reduce((sum, room) => sum + room, 0) / 2;
  for (const [i, robot] of robots.entries()) {
    robot.standAside(y + rooms[i]! / 2);
    y += rooms[i]!;
  }
}

/** A box aligned with the world's axes, metres. */
export interface Box {
  readonly min: Vec3;
  readonly max: Vec3;
}

/** A robot in a row; its body may not be loaded yet. */
export interface RowNode extends RowItem {
  readonly figure: {
    readonly root: { readonly matrixWorld: { readonly elements: ArrayLike<number> } };
    readonly boxes: Iterable<PlacedBox>;
  } | null;
  /** Its heading, rad from the world's x axis. */
  readonly heading: number;
  /** Its bounding box in the world; null while there is no model. */
  box(): Box | null;
  dispose(): void;
}

/** The robots of one view, side by side. The first is the main one. */
export class RobotRow<N extends RowNode> {
  readonly #robots: N[] = [];

  /** All robots; seen from the front, the first is on the right of the picture. */
  get robots(): readonly N[] {
    return this.#robots;
  }

  get several(): boolean {
    return this.#robots.length > 1;
  }

  /** The heading of a single robot, rad from the world's x axis; 0 for several, which have no common heading. */
  get heading(): number {
    return this.several ? 0 : (this.#robots[0]?.heading ?? 0);
  }

  add(robot: N): void {
    this.#robots.push(robot);
  }

  /** Lays several robots out side by side. Returns the box around all; null without a model. */
  arrange(): Box | null {
    if (this.several) layOutRow(this.#robots);
    const boxes = this.#robots.flatMap((robot) => robot.box() ?? []);
    if (boxes.length === 0) return null;
    const far = (corner: 'min' | 'max', axis: 0 | 1 | 2) =>
      Math[corner](...boxes.map((box) => box[corner][axis]));
    const corner = (of: 'min' | 'max'): Vec3 => [far(of, 0), far(of, 1), far(of, 2)];
    return { min: corner('min'), max: corner('max') };
  }

  /** The mean position of their root links on the floor; null without a model. */
  middle(): { readonly x: number; readonly y: number } | null {
    const roots = this.#robots.flatMap(({ figure }) => figure?.root.matrixWorld ?? []);
    if (roots.length === 0) return null;
    const mean = (at: number) => roots.reduce((sum, { elements }) => sum + elements[at]!, 0) / roots.length;
    return { x: mean(12), y: mean(13) };
  }

  /** The cylinder around all of them; null while none has a body. */
  span(): BodySpan | null {
    return spanOf(this.#robots.flatMap(({ figure }) => [...(figure?.boxes ?? [])]));
  }

  dispose(): void {
    for (const robot of this.#robots) robot.dispose();
  }
}

/** The middle of the top of a robot's bounding box; null while it has no body. */
export function topOf(robot: RowNode): Vec3 | null {
  const box = robot.box();
  if (box === null) return null;
  const { min, max } = box;
  return [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, max[2]];
}
