import { type Camera, Vector3 } from 'three';
import { RobotRow, topOf } from '../figure/robot_row.ts';
import type { RobotNode } from './robot_node.ts';
import type { SceneTheme } from './theme.ts';

/** The robots of one scene. */
export class SceneRow extends RobotRow<RobotNode> {
  /** Whether any robot is limited to a coarser level than available. */
  get coarse(): boolean {
    return this.robots.some(({ coarse }) => coarse);
  }

  /** Whether all robots have built models, which the light view can show as well. */
  get built(): boolean {
    return this.robots.every(({ built }) => built);
  }

  /** The boxes of all links of all robots, each with its link's transform. */
  get boxes() {
    return this.robots.flatMap(({ figure }) => [...(figure?.boxes ?? [])]);
  }

  /** Where the top of a robot appears in the picture (x right, y up, −1…1); null while it has no body or is behind the camera. */
  topOf(robot: RobotNode, camera: Camera): { x: number; y: number } | null {
    const top = topOf(robot);
    if (top === null) return null;
    POINT.set(...top).project(camera);
    return POINT.z > 1 ? null : { x: POINT.x, y: POINT.y };
  }

  setTheme(theme: SceneTheme): void {
    for (const robot of this.robots) robot.setTheme(theme);
  }

  setPixelRatio(ratio: number): void {
    for (const { staleEffect } of this.robots) staleEffect.setPixelRatio(ratio);
  }

  /** Sets whether only their coarsest levels are shown, for a slow device. */
  keepCoarse(coarse: boolean): void {
    for (const robot of this.robots) robot.keepCoarse(coarse);
  }
}

const POINT = new Vector3();
