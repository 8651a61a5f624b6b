import {
  BufferGeometry,
  type Color,
  type DataTexture,
  DoubleSide,
  Mesh,
  MeshLambertMaterial,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { type Joint, Kinematics } from '../../model/kinematics.ts';
import type { Lod } from '../../model/lod.ts';
import type { LinkLook } from '../../model/posed_body.ts';
import type { JointValues } from '../../twin/playback/pose.ts';
import type { FigureGhost } from '../figure/figure_node.ts';
import { declare, insertAfter } from './shader_text.ts';
import { Bones, injectSkinning, type SkinTones } from './skin.ts';
import type { StaleEffect } from './stale_effect.ts';

const OPACITY = 0.35;
/** Render order: after the robot, so that the robot shows through. */
const GLASS_ORDER = 2;

/**
 * A transparent copy of a robot in another pose, usually the commanded one. It shares the robot's geometry buffers and root, has
 * its own bones, and costs one draw call.
 */
export class Ghost implements FigureGhost {
  /** A child of the robot's root. Empty until the robot has its first level. */
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

  setJoints(joints: JointValues, instead: JointValues | null = null): boolean {
    if (!this.#kinematics.set(joints, instead)) return false;
    this.#kinematics.compute();
    this.#bend();
    return true;
  }

  /** root_from_link of every link in the robot's order: 16 numbers each, column-major. Read only. */
  get rootFromLink(): Float64Array {
    return this.#kinematics.rootFromLink;
  }

  /** Sets how a link is shown; a ghost uses only `fade` and `hide`. */
  setLook(link: string, { fade = 0, hide = false }: LinkLook): void {
    const wanted = this.#linkOf.get(link);
    if (wanted === undefined) return;
    for (let visual = 0; visual < this.#linkOfVisual.length; visual += 1) {
      if (this.#linkOfVisual[visual] === wanted) this.#bones.setLook(visual, { fade, hide });
    }
  }

  /** Uses a level's geometry, which still belongs to the robot: the ghost does not dispose of it. */
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

/** The material of a ghost: the accent colour, transparent where the surface faces the camera and denser at its edges. Like a
 *  skin it follows `bones`, and each link can fade individually. */
export function glass(
  staleEffect: StaleEffect,
  accent: { value: Color },
  bones: { value: DataTexture },
): MeshLambertMaterial {
  const material = new MeshLambertMaterial({
    transparent: true,
    opacity: OPACITY,
    depthWrite: false,
    side: DoubleSide,
    polygonOffset: true, // where ghost and body coincide, the body is visible
    polygonOffsetFactor: 2,
    polygonOffsetUnits: 24,
    forceSinglePass: true, // otherwise three.js draws back and front faces in two calls
  });
  material.onBeforeCompile = (shader) => {
    staleEffect.patch(shader);
    shader.uniforms.accent = accent;
    tint(shader);
    shader.uniforms.bones = bones;
    injectSkinning(shader, BONES);
  };
  material.customProgramCacheKey = () => 'glass';
  return material;
}

const BONES = `
attribute vec2 part;
uniform highp sampler2D bones;
flat varying vec2 look;
`;

const COLOR = `
diffuseColor.rgb = accent;
diffuseColor.a *= 1.0 - look.y;
if (diffuseColor.a <= 0.0) discard;
`;

const EDGE = `
float edge = 1.0 - abs(dot(normal, normalize(vViewPosition)));
diffuseColor.a *= 0.4 + 2.0 * edge * edge;
totalEmissiveRadiance += accent * (0.3 + 0.5 * edge);
`;

function tint(shader: WebGLProgramParametersWithUniforms): void {
  const head = 'uniform vec3 accent;\nflat varying vec2 look;\n';
  const coloured = insertAfter(declare(shader.fragmentShader, head), 'color_fragment', COLOR);
  shader.fragmentShader = insertAfter(coloured, 'emissivemap_fragment', EDGE);
}
