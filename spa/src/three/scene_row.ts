import { type Camera, Vector3 } from 'three';
import { RobotRow, topOf } from '../view/robot_row.ts';
import type { RobotNode } from './robot_node.ts';
import type { SceneTheme } from './theme.ts';

/** The robots of one scene. */
export class SceneRow extends RobotRow<RobotNode> {
  /** Whether one of them shows less than it could. */
  get coarse(): boolean {
    return this.robots.some(({ coarse }) => coarse);
  }

  /** Whether all are of built models, which every view can show. */
  get built(): boolean {
    return this.robots.every(({ built }) => built);
  }

  /** Boxes of all their links, with what moves them. */
  get boxes() {
    return this.robots.flatMap(({ figure }) => [...(figure?.boxes ?? [])]);
  }

  /** Where the top of one of them is in the picture, both -1…1, right and up; null while it has no body or is behind the eye. */
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

  /** Their coarsest levels only: for a slow device. */
  keepCoarse(coarse: boolean): void {
    for (const robot of this.robots) robot.keepCoarse(coarse);
  }
}

const POINT = new Vector3();
