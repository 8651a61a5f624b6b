import type { Object3D } from 'three';
import type { SceneTheme } from './theme.ts';

/** Something that a scene shows in addition to robots and floor, such as the overlay. */
export interface ScenePart {
  /** Added to the world (Z up, metres) while the part is in the scene. */
  readonly object: Object3D;
  /** Called when a robot has a new pose or model. A picture is drawn in any case. */
  follow?(): void;
  setTheme?(theme: SceneTheme): void;
  /** Called in every tick; returns true while it needs more. */
  advance?(seconds: number, nowMs: number): boolean;
  dispose(): void;
}
