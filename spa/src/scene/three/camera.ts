import { PerspectiveCamera, Ray, TOUCH } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { prefersReducedMotion } from '../../browser/painting.ts';
import { CameraRig, LOWEST } from '../camera/camera_rig.ts';
import { FIELD_OF_VIEW } from '../camera/framing.ts';
import type { Fingers } from '../figure/body_view.ts';

/** The three.js camera of a `CameraRig`, in a world with Z up. Pointer input is handled by three's `OrbitControls`. */
export class SceneCamera {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
  readonly rig: CameraRig;
  readonly #controls: OrbitControls;

  /** `onChange` is called when a new picture is needed. */
  constructor(canvas: HTMLElement, onChange: () => void) {
    this.camera.up.set(0, 0, 1); // before the controls: they read it once
    this.#controls = new OrbitControls(this.camera, canvas);
    // No inertia: it is counted in frames, so on a slow machine the view would lag behind the hand.
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

  /** Sets what fingers do; see `BodyView`. */
  setFingers(fingers: Fingers): void {
    const { touches, domElement } = this.#controls;
    touches.ONE = fingers === 'all' ? TOUCH.ROTATE : null;
    touches.TWO = fingers === 'all' ? TOUCH.DOLLY_PAN : TOUCH.DOLLY_ROTATE;
    if (domElement !== null) domElement.style.touchAction = fingers === 'all' ? 'none' : 'pan-y';
  }

  /** Pans the world by this many CSS pixels, in the picture plane. */
  pan(dx: number, dy: number): void {
    this.rig.grasp();
    this.#controls.pan(dx, dy);
  }

  /** The ray (world) from the camera through a point of the picture (x right, y up, −1…1). Always the same object. */
  ray({ x, y }: { readonly x: number; readonly y: number }): Ray {
    RAY.origin.setFromMatrixPosition(this.camera.matrixWorld);
    RAY.direction.set(x, y, 0.5).unproject(this.camera).sub(RAY.origin).normalize();
    return RAY;
  }

  dispose(): void {
    this.#controls.dispose();
  }

  /** Copies the rig's state. The field of view applies to the uncovered part; the picture extends beyond it. */
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
