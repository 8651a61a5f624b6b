import { Color, DoubleSide, FrontSide, type MeshLambertMaterial, MeshStandardMaterial } from 'three';
import { glass } from '../robot/glass.ts';
import type { StaleEffect } from '../robot/stale_effect.ts';

const ROUGHNESS = 0.6;

/** The matt shells of one robot, one material for each colour, however many links name it; and the glass of its ghost. */
export class Palette {
  readonly #staleEffect: StaleEffect;
  readonly #accent: { value: Color };
  readonly #shells = new Map<string, MeshStandardMaterial>();
  #glass: MeshLambertMaterial | null = null;

  constructor(staleEffect: StaleEffect, accent: { value: Color }) {
    this.#staleEffect = staleEffect;
    this.#accent = accent;
  }

  /** What its ghost is made of. */
  glass(): MeshLambertMaterial {
    this.#glass ??= glass(this.#staleEffect, this.#accent);
    return this.#glass;
  }

  /** `color` in the working space (linear), `opacity` 0…1; a surface that is not closed shows its inner side, too. */
  shell(color: Color, opacity: number, closed: boolean): MeshStandardMaterial {
    const tone = [color.r, color.g, color.b, opacity].map((part) => part.toFixed(4)).join(' ');
    const key = `${tone} ${closed}`;
    let shell = this.#shells.get(key);
    if (shell === undefined) {
      shell = new MeshStandardMaterial({
        color: new Color().copy(color),
        roughness: ROUGHNESS,
        metalness: 0,
        opacity,
        transparent: opacity < 1,
        depthWrite: opacity >= 1,
        side: closed ? FrontSide : DoubleSide,
      });
      this.#staleEffect.attach(shell);
      this.#shells.set(key, shell);
    }
    return shell;
  }

  dispose(): void {
    for (const shell of this.#shells.values()) shell.dispose();
    this.#shells.clear();
    this.#glass?.dispose();
  }
}
