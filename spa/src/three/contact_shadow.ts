import { type Matrix4, Vector4 } from 'three';
import { type LinkBox, lowestZ } from '../model/bounds.ts';

/** Links that come near the floor at one time: feet, and hands and knees of one that crawls. */
export const MOST_CONTACTS = 6;
/** Higher than this (in reaches of the robot) a link has no contact shadow any more. */
const FADES_AT = 0.05;
const FORGOTTEN_AT = 0.16;

/**
 * Where a robot touches the floor, as rounded rectangles: the dark under a sole that a shadow map is too coarse for, and
 * that tells a foot that stands from one that hovers.
 */
export class ContactShadow {
  /** Centre x, y, and the direction of the longer side (cosine, sine). */
  readonly place = Array.from({ length: MOST_CONTACTS }, () => new Vector4());
  /** Half the longer side, half the other (m), and how near it is: 1 touches, 0 is none. */
  readonly size = Array.from({ length: MOST_CONTACTS }, () => new Vector4());

  /** `reach`: the robot's radius, m. */
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

  /** The box as it is seen from above. */
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
