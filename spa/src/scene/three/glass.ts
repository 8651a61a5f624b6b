import {
  type Color,
  type DataTexture,
  DoubleSide,
  MeshLambertMaterial,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { declare, insertAfter } from './shader_text.ts';
import { injectSkinning } from './skin.ts';
import type { StaleEffect } from './stale_effect.ts';

const OPACITY = 0.35;
/** Render order: after the robot, so that the robot shows through. */
export const GLASS_ORDER = 2;

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
