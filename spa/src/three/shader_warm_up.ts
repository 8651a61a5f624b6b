import type { Camera, Scene, WebGLRenderer } from 'three';
import type { Lod } from '../model/lod.ts';
import { Bones, Skin, type SkinTones } from './robot/skin.ts';
import type { StaleEffect } from './robot/stale_effect.ts';

/** No shells at all, painted white. */
const NOTHING: Lod = {
  positions: new Int16Array(4),
  normals: new Int8Array(4),
  parts: new Uint16Array(2),
  uvs: null,
  index: new Uint32Array(),
  draws: [{ start: 0, count: 0, picture: null }],
  linkFromMesh: new Float64Array(16),
  boxes: new Int16Array(6),
  ranges: [[]],
  paints: Float32Array.of(1, 1, 1, 1),
  pictures: [],
};

/**
 * Has the card's program for shells made while the shells are still on their way: on a phone that takes a third of a
 * second, and it would begin only when they are here. Returns the end of it, for when a robot is dressed.
 */
export function warmUp(
  renderer: WebGLRenderer,
  scene: Scene,
  camera: Camera,
  staleEffect: StaleEffect,
  tones: SkinTones,
): () => void {
  const bones = new Bones(1);
  const skin = new Skin(NOTHING, [], bones, staleEffect, tones);
  renderer.compile(skin.mesh, camera, scene);
  return () => {
    skin.dispose();
    bones.dispose();
  };
}
