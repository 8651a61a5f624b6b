import type { Color } from 'three';
import { BufferGeometry, Float32BufferAttribute, LineBasicMaterial, LineSegments } from 'three';
import type { RawManifest } from '../../model/bundle.ts';

const HATCHES = 4;

/** Why a mesh is not in the bundle; null if it is. */
export function whyAbsent(uri: string, manifest: RawManifest): string | null {
  if (manifest.missing.has(uri)) return 'not found by the robot';
  if (!manifest.files.has(uri)) return 'not in the bundle';
  return null;
}

/** Line segments (pairs of points, x, y, z each) of a hatched box with edge length 1 around the origin. */
export function hatchedBox(): Float32Array {
  const points: number[] = [];
  const line = (axis: number, side: number, u0: number, v0: number, u1: number, v1: number) => {
    for (const [u, v] of [
      [u0, v0],
      [u1, v1],
    ] as const) {
      const point = [0, 0, 0];
      point[axis] = side;
      point[(axis + 1) % 3] = u - 0.5;
      point[(axis + 2) % 3] = v - 0.5;
      points.push(...point);
    }
  };
  for (let axis = 0; axis < 3; axis += 1) {
    for (const side of [-0.5, 0.5]) {
      line(axis, side, 0, 0, 1, 0); // two edges per face make the twelve of the box
      line(axis, side, 0, 1, 1, 1);
      for (let i = 1; i < 2 * HATCHES; i += 1) {
        const at = i / HATCHES; // the line u + v = at, inside the unit square
        line(axis, side, Math.max(0, at - 1), Math.min(1, at), Math.min(1, at), Math.max(0, at - 1));
      }
    }
  }
  return Float32Array.from(points);
}

/** Makes placeholders of missing meshes: hatched boxes in the caution colour, unlike any part of the robot. */
export class Placeholders {
  readonly #geometry = new BufferGeometry().setAttribute(
    'position',
    new Float32BufferAttribute(hatchedBox(), 3),
  );
  readonly #material = new LineBasicMaterial({ toneMapped: false });

  setColor(color: Color): void {
    this.#material.color.copy(color);
  }

  /** A box with this edge length in metres, around the link's origin. */
  make(size: number): LineSegments {
    const box = new LineSegments(this.#geometry, this.#material);
    box.scale.setScalar(size);
    return box;
  }

  dispose(): void {
    this.#geometry.dispose();
    this.#material.dispose();
  }
}
