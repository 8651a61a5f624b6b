import { type Camera, Group, Vector3 } from 'three';
import type { Moving } from '../figure/render_loop.ts';
import type { LabelRoom } from '../signs/label_layout.ts';
import { Overlay } from '../signs/overlay.ts';
import type { RobotSigns } from '../signs/signs.ts';
import { FacetMesh, OverlayMesh } from './overlay_mesh.ts';
import type { RobotNode } from './robot_node.ts';
import { type SceneTheme, THEMES } from './theme.ts';

/** What the overlay needs from its scene. */
export interface OverlayHost {
  readonly host: HTMLElement;
  readonly camera: Camera;
  /** The picture, and its uncovered part. */
  room(): LabelRoom;
  /** Asks for a picture. */
  changed(): void;
  /** Asks for a tick, because something may move. */
  wake(): void;
}

/** The overlay of all robots in a scene, in two draw calls and two more for filled areas, with its labels over the canvas. */
export class OverlayPart implements Moving {
  readonly object = new Group();
  readonly #view: OverlayHost;
  readonly #overlay: Overlay;
  readonly #batch: OverlayMesh;
  #filled: FacetMesh | null = null;

  constructor(view: OverlayHost) {
    this.#view = view;
    this.#overlay = new Overlay(view.host, THEMES.dark.signs, true);
    this.#batch = new OverlayMesh(this.#overlay.strokes);
    this.object.add(this.#batch.object);
  }

  /** Whether the newest picture has balance signs. Nothing else is drawn under the robot then: red axes between them would look
   *  like a warning. */
  get balanced(): boolean {
    return (this.#overlay.facets?.count ?? 0) > 0;
  }

  drawn(of: RobotNode): Readonly<Record<string, unknown>> {
    if (this.#make()) this.#view.changed();
    return this.#overlay.drawn(of);
  }

  /** Takes a robot's signs whenever they have read a frame; they are drawn in the next tick. */
  show(of: RobotNode, signs: RobotSigns): void {
    this.#overlay.show(of, signs);
    this.#view.wake();
  }

  /** Call this when a robot has moved. */
  follow(): void {
    this.#overlay.moved();
  }

  /** Measures the robots' sizes again, for example after more of their meshes have loaded. */
  measure(): void {
    this.#overlay.measure();
  }

  setTheme({ signs }: SceneTheme): void {
    this.#overlay.setColors(signs);
  }

  advance(seconds: number): boolean {
    const moving = this.#overlay.advance(seconds);
    if (this.#make()) this.#view.changed();
    this.#placeLabels();
    return moving;
  }

  /** Call before a picture is drawn: robots may have moved since the last tick. */
  prepare(): void {
    if (this.#make()) this.#placeLabels();
  }

  /** Call when the picture's size has changed. */
  resize(): void {
    this.#placeLabels();
  }

  dispose(): void {
    this.#batch.dispose();
    this.#filled?.dispose();
    this.#overlay.dispose();
  }

  #make(): boolean {
    const other = this.#overlay.make();
    if (!other) return false;
    this.#batch.update();
    const { facets } = this.#overlay;
    if (facets !== null && facets.count > 0 && this.#filled === null) {
      this.#filled = new FacetMesh(facets);
      this.object.add(this.#filled.object);
    }
    this.#filled?.update();
    return true;
  }

  #placeLabels(): void {
    const { camera } = this.#view;
    const room = this.#view.room();
    const { width, height } = room;
    camera.updateMatrixWorld();
    this.#overlay.placeLabels((at) => {
      POINT.set(...at).project(camera);
      if (!(POINT.z > -1 && POINT.z < 1)) return null;
      return { x: ((POINT.x + 1) / 2) * width, y: ((1 - POINT.y) / 2) * height };
    }, room);
  }
}

const POINT = new Vector3();
