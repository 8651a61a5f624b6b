import { type Camera, type Group, Vector3 } from 'three';
import { SignBoard } from '../overlays/overlay.ts';
import type { ShownSigns, SignManner } from '../overlays/robot_overlay.ts';
import type { SignReadings } from '../twin/overlay/reader.ts';
import { SignBatch } from './overlay_mesh.ts';
import type { StagedRobot } from './robot_node.ts';
import type { ScenePart } from './scene_part.ts';
import { type SceneTheme, THEMES } from './theme.ts';

export interface SignsView {
  readonly host: HTMLElement;
  readonly camera: Camera;
  /** A picture, please. */
  changed(): void;
  /** A tick, please: something may move. */
  wake(): void;
}

/** All signs of all robots in a scene. Two draw calls. */
export class Signs implements ScenePart {
  readonly object: Group;
  readonly #view: SignsView;
  readonly #board: SignBoard;
  readonly #batch: SignBatch;
  #size = { width: 1, height: 1 };

  constructor(view: SignsView) {
    this.#view = view;
    this.#board = new SignBoard(view.host, THEMES.dark.signs);
    this.#batch = new SignBatch(this.#board.strokes);
    this.object = this.#batch.object;
  }

  shown(of: StagedRobot): ShownSigns {
    if (this.#make()) this.#view.changed();
    return this.#board.shown(of);
  }

  /** The newest readings and how they are wanted; they are drawn in the next tick. */
  show(of: StagedRobot, readings: SignReadings | null, manner?: SignManner): void {
    this.#board.show(of, readings, manner);
    this.#view.wake();
  }

  follow(): void {
    this.#board.moved();
  }

  /** Robots may have another size. */
  measure(): void {
    this.#board.measure();
  }

  setTheme({ signs }: SceneTheme): void {
    this.#board.setTones(signs);
  }

  advance(seconds: number): boolean {
    const moving = this.#board.advance(seconds);
    if (this.#make()) this.#view.changed();
    this.#placeLabels();
    return moving;
  }

  /** Before a picture: robots may have moved since the last tick. */
  prepare(): void {
    if (this.#make()) this.#placeLabels();
  }

  /** The picture is so large, CSS px. Asking the page for it in every tick would make it lay itself out in every tick. */
  setSize(width: number, height: number): void {
    this.#size = { width, height };
    this.#placeLabels();
  }

  dispose(): void {
    this.#batch.dispose();
    this.#board.dispose();
  }

  #make(): boolean {
    const other = this.#board.make();
    if (other) this.#batch.update();
    return other;
  }

  #placeLabels(): void {
    const { camera } = this.#view;
    const { width, height } = this.#size;
    camera.updateMatrixWorld();
    this.#board.placeLabels((at) => {
      POINT.set(...at).project(camera);
      if (!(POINT.z > -1 && POINT.z < 1)) return null;
      return { x: ((POINT.x + 1) / 2) * width, y: ((1 - POINT.y) / 2) * height };
    }, width);
  }
}

const POINT = new Vector3();
