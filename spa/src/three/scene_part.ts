import type { Object3D } from 'three';
import type { SceneTheme } from './theme.ts';

/** Something that a scene shows beside shells and floor: a ghost, arrows, a plane. Each kind is a file of its own. */
export interface ScenePart {
  /** Hung into the world (Z up, metres) while the part is in the scene. */
  readonly object: Object3D;
  /** A robot has a new pose or a new model: go along with it. The picture is drawn anyway. */
  follow?(): void;
  setTheme?(theme: SceneTheme): void;
  /** Takes part in every tick; true while it needs more. */
  advance?(seconds: number, nowMs: number): boolean;
  dispose(): void;
}
