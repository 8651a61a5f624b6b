import { type Matrix4, Vector4 } from 'three';
import { type LinkBox, lowestZ } from '../../model/bounds.ts';

/** Most links with a contact shadow at a time: two feet, or hands, knees and feet of a crawling robot. */
export const MOST_CONTACTS = 6;
/** Heights in radii of the robot: the shadow falls to 1/e at the first, and is omitted from the second on. */
const FADES_AT = 0.05;
const FORGOTTEN_AT = 0.16;

/**
 * Contact shadows: rounded dark rectangles where a robot is close to the floor. The shadow map is too coarse to show whether a
 * foot touches the floor or hovers; these do.
 */
export class ContactShadow {
  /** For each contact: centre x, y (m), and the direction of the longer side (cosine, sine). */
  readonly place = Array.from({ length: MOST_CONTACTS }, () => new Vector4());
  /** For each contact: half the longer side, half the other (m), and strength: 1 touches the floor, 0 is no contact. */
  readonly size = Array.from({ length: MOST_CONTACTS }, () => new Vector4());

  /** Computes the contacts from the links' boxes. `reach`: the robot's radius, m. */
  follow(
    boxes: Iterable<readonly [link: { readonly matrixWorld: Matrix4 }, box: LinkBox]>,
    reach: number,
  ): void {
    const near: { z: number; m: ArrayLike<number>; box: LinkBox }[] = [];
    for (const [{ matrixWorld }, box] of boxes) {
      const z = Math.max(0, lowestZ(box, matrixWorld.elements));
      if (z < FORGOTTEN_AT * reach) near.push({ z, m: matrixWorld.elements, box });
    }
    near.sort((a, b) => a.z - b.z);
    for (let i = 0; i < MOST_CONTACTS; i += 1) {
      const found = near[i];
      if (found === undefined) this.size[i]!.set(0, 0, 0, 0);
      else this.#print(i, found.m, found.box, Math.exp(-found.z / (FADES_AT * reach)));
    }
  }

  /** Writes contact i: the rectangle around the box as seen from above. */
  #print(i: number, m: ArrayLike<number>, { min, max }: LinkBox, strength: number): void {
    let [x, y] = [m[12]!, m[13]!];
    let [alongX, alongY, longest] = [1, 0, 0];
    const sides = [0, 1, 2].map((axis) => {
      const half = (max[axis]! - min[axis]!) / 2;
      const middle = (max[axis]! + min[axis]!) / 2;
      const [dx, dy] = [m[axis * 4]!, m[axis * 4 + 1]!];
      x += dx * middle;
      y += dy * middle;
      const flat = Math.hypot(dx, dy);
      if (flat * half > longest) [alongX, alongY, longest] = [dx / flat, dy / flat, flat * half];
      return [dx * half, dy * half] as const;
    });
    const extent = (ex: number, ey: number) =>
      sides.reduce((sum, [dx, dy]) => sum + Math.abs(dx * ex + dy * ey), 0);
    this.place[i]!.set(x, y, alongX, alongY);
    this.size[i]!.set(extent(alongX, alongY), extent(-alongY, alongX), strength, 0);
  }
}
