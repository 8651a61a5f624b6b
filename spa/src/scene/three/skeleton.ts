import { BufferAttribute, BufferGeometry, type Color, LineBasicMaterial, LineSegments } from 'three';
import type { Figure } from './figure.ts';

/** Lines from link to link, which show the robot's motion before any mesh is loaded. */
export class Skeleton {
  readonly lines: LineSegments;
  readonly #ends: readonly string[];

  constructor(figure: Figure, color: Color) {
    this.#ends = [...figure.bones()].flat();
    const position = new BufferAttribute(new Float32Array(this.#ends.length * 3), 3);
    const geometry = new BufferGeometry().setAttribute('position', position);
    this.lines = new LineSegments(geometry, new LineBasicMaterial({ color, toneMapped: false }));
    this.lines.frustumCulled = false; // its bounds change with every pose
  }

  follow(figure: Figure): void {
    const position = this.lines.geometry.getAttribute('position');
    for (const [i, name] of this.#ends.entries()) {
      const m = figure.linkMatrix(name)?.elements;
      if (m !== undefined) position.setXYZ(i, m[12]!, m[13]!, m[14]!);
    }
    position.needsUpdate = true;
  }

  dispose(): void {
    this.lines.removeFromParent();
    this.lines.geometry.dispose();
    (this.lines.material as LineBasicMaterial).dispose();
  }
}
