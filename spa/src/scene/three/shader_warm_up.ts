import type { Camera, Scene, WebGLRenderer } from 'three';
import type { Lod } from '../../model/lod.ts';
import { Bones, Skin, type SkinTones } from './skin.ts';
import type { StaleEffect } from './stale_effect.ts';

/** An empty level with one white paint. */
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
 * Compiles the robot's shader while its meshes are still loading: on a phone that takes a third of a second, and would otherwise
 * start only once they have loaded. Returns a function that disposes of the stand-in, once a robot has meshes.
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
