import type { Elements, LinkBox } from '../../model/bounds.ts';
import { cornersOf } from '../../model/bounds.ts';

/** An upright cylinder around the whole body, in the world, metres. Turning about the vertical does not change it. */
export interface BodySpan {
  /** Its axis. */
  readonly x: number;
  readonly y: number;
  readonly radius: number;
  /** Its lower and upper end. */
  readonly low: number;
  readonly high: number;
}

/** A link's bounding box, with the link's pose. */
export type PlacedBox = readonly [
  link: { readonly matrixWorld: { readonly elements: Elements } },
  box: LinkBox,
];

/** The cylinder around these boxes; its axis is the middle of the floor area that they cover. Null for none, or if one of them
 *  has no finite position. */
export function spanOf(boxes: Iterable<PlacedBox>): BodySpan | null {
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  const points: number[] = [];
  for (const [{ matrixWorld }, box] of boxes) {
    cornersOf(box, matrixWorld.elements, 0, (x, y, z) => {
      points.push(x, y);
      min[0] = Math.min(min[0]!, x);
      min[1] = Math.min(min[1]!, y);
      min[2] = Math.min(min[2]!, z);
      max[0] = Math.max(max[0]!, x);
      max[1] = Math.max(max[1]!, y);
      max[2] = Math.max(max[2]!, z);
    });
  }
  const [x, y] = [(min[0]! + max[0]!) / 2, (min[1]! + max[1]!) / 2];
  let radius = 0;
  for (let i = 0; i < points.length; i += 2) {
    radius = Math.max(radius, Math.hypot(points[i]! - x, points[i + 1]! - y));
  }
  const span = { x, y, radius, low: min[2]!, high: max[2]! };
  return Object.values(span).every(Number.isFinite) ? span : null;
}
