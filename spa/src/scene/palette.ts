import { Color, DoubleSide, MeshStandardMaterial } from 'three';
import type { Drain } from './stale.ts';

const ROUGHNESS = 0.6;

/** The matt shells of one robot: one material for each colour, however many links name it. */
export class Palette {
  readonly #drain: Drain;
  readonly #shells = new Map<string, MeshStandardMaterial>();

  constructor(drain: Drain) {
    this.#drain = drain;
  }

  /** `color` in the working space (linear), `opacity` 0…1. */
  shell(color: Color, opacity: number): MeshStandardMaterial {
    const key = `${color.r.toFixed(4)} ${color.g.toFixed(4)} ${color.b.toFixed(4)} ${opacity.toFixed(3)}`;
    let shell = this.#shells.get(key);
    if (shell === undefined) {
      shell = new MeshStandardMaterial({
        color: new Color().copy(color),
        roughness: ROUGHNESS,
        metalness: 0,
        opacity,
        transparent: opacity < 1,
        depthWrite: opacity >= 1,
        side: DoubleSide, // CAD shells are often open; a hole where one looks inside is worse than the fill rate
      });
      this.#drain.attach(shell);
      this.#shells.set(key, shell);
    }
    return shell;
  }

  dispose(): void {
    for (const shell of this.#shells.values()) shell.dispose();
    this.#shells.clear();
  }
}
