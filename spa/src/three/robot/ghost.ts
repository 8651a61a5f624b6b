import { BufferGeometry, Mesh, type MeshLambertMaterial } from 'three';
import { type Joint, Kinematics } from '../../model/kinematics.ts';
import type { Lod } from '../../model/lod.ts';
import type { LinkLook } from '../../model/posed_body.ts';
import type { FigureGhost } from './figure.ts';
import { GLASS_ORDER, glass } from './glass.ts';
import { Bones, type SkinTones } from './skin.ts';
import type { StaleEffect } from './stale_effect.ts';

/**
 * The same robot once more, in another pose: where it was told to be. It wears the shells of its robot (the very
 * buffers), has bones of its own, and costs one draw call. Its root is the robot's.
 */
export class Ghost implements FigureGhost {
  /** Hangs below the robot's root. Empty until the robot wears its first level. */
  readonly mesh: Mesh<BufferGeometry, MeshLambertMaterial>;
  readonly #kinematics: Kinematics;
  readonly #linkOfVisual: ArrayLike<number>;
  readonly #linkOf: ReadonlyMap<string, number>;
  readonly #bones: Bones;
  readonly #onGone: (ghost: Ghost) => void;
  #level: Lod | null = null;

  constructor(
    joints: readonly Joint[],
    linkOf: ReadonlyMap<string, number>,
    linkOfVisual: ArrayLike<number>,
    staleEffect: StaleEffect,
    { accent }: SkinTones,
    onGone: (ghost: Ghost) => void,
  ) {
    this.#kinematics = new Kinematics(joints);
    this.#linkOf = linkOf;
    this.#linkOfVisual = linkOfVisual;
    this.#bones = new Bones(linkOfVisual.length);
    this.#onGone = onGone;
    const material = glass(staleEffect, accent, { value: this.#bones.texture });
    this.mesh = new Mesh(new BufferGeometry(), material);
    this.mesh.visible = false;
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = GLASS_ORDER;
  }

  /** Turns its joints; rad or m by URDF name. False when nothing changed: then there is nothing to draw. */
  setJoints(joints: ReadonlyMap<string, number>): boolean {
    if (!this.#kinematics.set(joints)) return false;
    this.#kinematics.compute();
    this.#bend();
    return true;
  }

  /** root_from_link of every link by the robot's order, 16 numbers each, column after column; read only. */
  get rootFromLink(): Float64Array {
    return this.#kinematics.rootFromLink;
  }

  /** How a link is shown: only `fade` and `hide` mean something for a ghost. */
  setLook(link: string, { fade = 0, hide = false }: LinkLook): void {
    const wanted = this.#linkOf.get(link);
    if (wanted === undefined) return;
    for (let visual = 0; visual < this.#linkOfVisual.length; visual += 1) {
      if (this.#linkOfVisual[visual] === wanted) this.#bones.setLook(visual, { fade, hide });
    }
  }

  /** The robot's shells, lent: whoever made the geometry disposes of it. */
  wear(level: Lod, geometry: BufferGeometry): void {
    this.#level = level;
    this.mesh.geometry = geometry;
    this.mesh.visible = true;
    this.#bend();
  }

  dispose(): void {
    this.mesh.removeFromParent();
    this.mesh.material.dispose();
    this.#bones.dispose();
    this.#onGone(this);
  }

  #bend(): void {
    if (this.#level === null) return;
    this.#bones.follow(this.#kinematics.rootFromLink, this.#linkOfVisual, this.#level.linkFromMesh);
  }
}
