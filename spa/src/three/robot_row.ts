import { Box3, type Camera, Vector3 } from 'three';
import { layOutRow } from '../view/row_layout.ts';
import type { RobotNode } from './robot_node.ts';
import type { SceneTheme } from './theme.ts';

/** The robots of one scene, side by side. The first is the one that the scene is of; others may stand beside it. */
export class RobotRow {
  readonly #robots: RobotNode[] = [];

  /** All of them, the first at the right of the picture from the front. */
  get robots(): readonly RobotNode[] {
    return this.#robots;
  }

  get several(): boolean {
    return this.#robots.length > 1;
  }

  /** Whether one of them shows less than it could. */
  get coarse(): boolean {
    return this.#robots.some(({ coarse }) => coarse);
  }

  /** Whether all are of built models, which every view can show. */
  get built(): boolean {
    return this.#robots.every(({ built }) => built);
  }

  /** Boxes of all their links, with what moves them. */
  get boxes() {
    return this.#robots.flatMap(({ figure }) => [...(figure?.boxes ?? [])]);
  }

  /** Where they look, rad from the world's x; several look nowhere together: 0. */
  get heading(): number {
    return this.several ? 0 : (this.#robots[0]?.heading ?? 0);
  }

  add(robot: RobotNode): void {
    this.#robots.push(robot);
  }

  /** Makes room for each. Returns what they fill together, world, metres: the same box every time; empty without a model. */
  arrange(): Box3 {
    if (this.several) layOutRow(this.#robots);
    ALL.makeEmpty();
    for (const robot of this.#robots) if (robot.figure !== null) ALL.union(robot.bounds(BOX));
    return ALL;
  }

  /** The middle of where they stand, the same vector every time; null without a model. */
  middle(): Readonly<Vector3> | null {
    let count = 0;
    MIDDLE.set(0, 0, 0);
    for (const { figure } of this.#robots) {
      if (figure === null) continue;
      MIDDLE.add(POINT.setFromMatrixPosition(figure.root.matrixWorld));
      count += 1;
    }
    return count === 0 ? null : MIDDLE.divideScalar(count);
  }

  /** Where the top of one of them is in a picture, both -1…1, right and up; null while it has no body or is behind the eye. */
  topOf(robot: RobotNode, camera: Camera): { x: number; y: number } | null {
    if (robot.figure === null) return null;
    const { max } = robot.bounds(BOX);
    BOX.getCenter(POINT).setZ(max.z).project(camera);
    return POINT.z > 1 ? null : { x: POINT.x, y: POINT.y };
  }

  setTheme(theme: SceneTheme): void {
    for (const robot of this.#robots) robot.setTheme(theme);
  }

  setPixelRatio(ratio: number): void {
    for (const { staleEffect } of this.#robots) staleEffect.setPixelRatio(ratio);
  }

  /** Their coarsest levels only: for a slow device. */
  keepCoarse(coarse: boolean): void {
    for (const robot of this.#robots) robot.keepCoarse(coarse);
  }

  dispose(): void {
    for (const robot of this.#robots) robot.dispose();
  }
}

const ALL = new Box3();
const BOX = new Box3();
const MIDDLE = new Vector3();
const POINT = new Vector3();
