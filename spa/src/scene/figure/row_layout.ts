/** Minimum room for a robot, also while it has no model, metres. */
const LEAST_ROOM = 0.3;
/** Room for a robot as a multiple of its width (for its arms) and of its height (for its name); the larger counts. */
const WIDTHS = 1.3;
const HEIGHTS = 0.6;

/** A robot that can stand in a row. */
export interface RowItem {
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
