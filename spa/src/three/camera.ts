import { MOUSE, PerspectiveCamera, Ray } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { prefersReducedMotion } from '../browser/reduced_motion.ts';
import type { MouseStyle } from '../view/body_view.ts';
import { CameraRig, LOWEST } from '../view/camera_rig.ts';
import { FIELD_OF_VIEW } from '../view/framing.ts';

/** A rig's eye as three.js draws from it, in a world whose Z is up. The hands on its canvas are three's own. */
export class SceneCamera {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
  readonly rig: CameraRig;
  readonly #controls: OrbitControls;

  /** `onChange`: a new picture is wanted. */
  constructor(canvas: HTMLElement, onChange: () => void) {
    this.camera.up.set(0, 0, 1); // before the controls: they read it once
    this.#controls = new OrbitControls(this.camera, canvas);
    // No inertia: it is counted in frames, so on a slow machine the view would swim behind the hand.
    this.#controls.maxPolarAngle = Math.PI / 2 - LOWEST;
    this.#controls.zoomToCursor = true;
    this.rig = new CameraRig({
      highest: Math.PI / 2 - 1e-6, // as near to a right angle as the controls go
      still: prefersReducedMotion,
      changed: () => {
        this.#apply();
        onChange();
      },
    });
    this.#controls.addEventListener('start', () => {
      this.rig.grasp();
      onChange();
    });
    this.#controls.addEventListener('change', () =>
      this.rig.hold({
        position: this.camera.position.toArray(),
        target: this.#controls.target.toArray(),
      }),
    );
    this.#apply();
  }

  /** What the mouse's buttons do. A finger always turns, two always pan and zoom. */
  setMouse(style: MouseStyle): void {
    const turning = { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN };
    const moving = { LEFT: MOUSE.PAN, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.ROTATE };
    this.#controls.mouseButtons = style === 'foxglove' ? moving : turning;
    this.#controls.screenSpacePanning = style !== 'foxglove'; // there one moves over the floor
  }

  /** The world goes along by so many CSS pixels: over the floor or not, as the mouse does. */
  pan(dx: number, dy: number): void {
    this.rig.grasp();
    this.#controls.pan(dx, dy);
  }

  /** From the eye through a point of the picture (both −1…1, right and up). The same one every time. */
  ray({ x, y }: { readonly x: number; readonly y: number }): Ray {
    RAY.origin.setFromMatrixPosition(this.camera.matrixWorld);
    RAY.direction.set(x, y, 0.5).unproject(this.camera).sub(RAY.origin).normalize();
    return RAY;
  }

  dispose(): void {
    this.#controls.dispose();
  }

  /** The whole of a view goes into the free part; the rest of the picture goes on around it. */
  #apply(): void {
    const { camera, rig } = this;
    const { width, height, top, free, near, far } = rig.projection;
    const { least, greatest } = rig.distances;
    this.#controls.minDistance = least;
    this.#controls.maxDistance = greatest;
    this.#controls.target.set(...rig.target);
    camera.near = near;
    camera.far = far;
    camera.aspect = width / free;
    camera.setViewOffset(width, free, 0, -top, width, height);
    camera.position.set(...rig.position);
    camera.lookAt(this.#controls.target);
  }
}

const RAY = new Ray();
