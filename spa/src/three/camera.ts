import { type Box3, MathUtils, MOUSE, PerspectiveCamera, Ray, Sphere, Spherical, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { prefersReducedMotion } from '../browser/reduced_motion.ts';
import { type Extent, extentOf } from '../model/bounds.ts';
import type { EyePlace, FollowMode, MouseStyle } from '../view/body_view.ts';
import { FIELD_OF_VIEW, fittingDistance, VIEWS, type ViewName } from '../view/framing.ts';
import { type Insets, ViewInsets } from '../view/insets.ts';

export type { ViewName } from '../view/framing.ts';

const EASE_SECONDS = 0.25;
/** The camera goes along once the robot is this part of its own size off the middle. */
const LEASH = 0.3;
/** A link that is looked at closely fills the picture as if it were this part of the robot. */
const CLOSE_PART = 0.35;

/** The eye, in a world whose Z is up: orbits, eases between named views, and goes along with a walking robot. */
export class CameraRig {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
  readonly #controls: OrbitControls;
  readonly #home = new Sphere(new Vector3(0, 0, 0.6), 0.75);
  readonly #insets = new ViewInsets();
  #extent: Extent = { tall: 0.6, wide: 0.4, radius: 0.75 };
  readonly #ease = { from: new Spherical(), to: new Spherical(), target: new Vector3(), left: 0 };
  #touched = false;
  /** Taken from elsewhere, and kept until somebody moves the eye: the robot may turn out to stand otherwise. */
  #placed: EyePlace | null = null;
  #yaw: number | null = null;
  /** The view that `home` means. */
  home: ViewName = 'home';
  followMode: FollowMode = 'along';

  /** `onChange`: a new picture is wanted. */
  constructor(canvas: HTMLElement, onChange: () => void) {
    this.camera.up.set(0, 0, 1); // before the controls: they read it once
    this.#controls = new OrbitControls(this.camera, canvas);
    // No inertia: it is counted in frames, so on a slow machine the view would swim behind the hand.
    this.#controls.maxPolarAngle = MathUtils.degToRad(89.5); // the floor has no underside
    this.#controls.zoomToCursor = true;
    this.#controls.addEventListener('start', () => {
      this.#grasp();
      onChange();
    });
    this.#controls.addEventListener('change', onChange);
    this.look('home', false);
  }

  /** What the eye looks at, metres. */
  get target(): Readonly<Vector3> {
    return this.#controls.target;
  }

  get eye(): EyePlace {
    return { position: this.camera.position.toArray(), target: this.target.toArray() };
  }

  /** The radius of the robot that was framed, metres. */
  get reach(): number {
    return this.#home.radius;
  }

  /** A robot that fills this box: looked at in its middle, which is about where a standing robot's pelvis is. A view
   *  that somebody has chosen by hand stays. */
  frame(box: Box3, eased = false): void {
    this.#extent = extentOf(box.min.toArray(), box.max.toArray());
    const { radius } = this.#extent;
    this.#home.set(box.getCenter(this.#home.center), radius);
    this.camera.near = radius / 100;
    this.camera.far = radius * 120;
    this.#controls.minDistance = radius / 8;
    this.#controls.maxDistance = radius * 25;
    this.camera.updateProjectionMatrix();
    if (this.#placed !== null) this.standAt(this.#placed);
    else if (!this.#touched) this.look('home', eased);
  }

  /** Where the eye is and what it looks at, from the floor under the middle of the robot, metres; null: the first view. */
  get stand(): EyePlace | null {
    if (!this.#touched) return null;
    const { x, y } = this.#home.center;
    const { position } = this.camera;
    const { target } = this.#controls;
    return {
      position: [position.x - x, position.y - y, position.z],
      target: [target.x - x, target.y - y, target.z],
    };
  }

  /** Stands there at once. */
  standAt(place: EyePlace): void {
    this.#grasp();
    this.#placed = place;
    const { x, y } = this.#home.center;
    this.#controls.target.set(place.target[0] + x, place.target[1] + y, place.target[2]);
    this.camera.position.set(place.position[0] + x, place.position[1] + y, place.position[2]);
    this.#controls.update();
  }

  /** Turns to a named view around where the robot now is. */
  look(view: ViewName, eased = true): void {
    const { azimuth, elevation } = VIEWS[view === 'home' ? this.home : view];
    this.#touched = view !== 'home';
    this.#placed = null;
    const { from, to, target } = this.#ease;
    target.copy(this.#home.center);
    to.set(
      fittingDistance(this.#extent, this.#insets.aspect),
      MathUtils.degToRad(90 - elevation),
      MathUtils.degToRad(azimuth),
    );
    zUpSpherical(OFFSET.copy(this.camera.position).sub(this.#controls.target), from);
    to.theta = from.theta + shorterTurn(to.theta - from.theta);
    this.#go(eased);
  }

  /** Comes close to a point (metres, world). */
  focus(at: Readonly<Vector3>, eased = true): void {
    this.#grasp();
    const { from, to, target } = this.#ease;
    target.copy(at);
    zUpSpherical(OFFSET.copy(this.camera.position).sub(this.#controls.target), from);
    to.set(fittingDistance(this.#extent, this.#insets.aspect) * CLOSE_PART, from.phi, from.theta);
    this.#go(eased);
  }

  /** Turns around what is looked at, rad: to the left, and up. */
  orbit(left: number, up: number): void {
    this.#grasp();
    this.#controls.rotateLeft(left);
    this.#controls.rotateUp(up);
  }

  /** The world goes along by so many CSS pixels. */
  pan(dx: number, dy: number): void {
    this.#grasp();
    this.#controls.pan(dx, dy);
  }

  /** `factor` below 1 comes nearer to what is looked at. */
  zoom(factor: number): void {
    this.#grasp();
    const { target } = this.#controls;
    OFFSET.copy(this.camera.position).sub(target);
    const { minDistance, maxDistance } = this.#controls;
    OFFSET.setLength(MathUtils.clamp(OFFSET.length() * factor, minDistance, maxDistance));
    this.camera.position.copy(target).add(OFFSET);
    this.#controls.update();
  }

  /** What the mouse's buttons do. A finger always turns, two always pan and zoom. */
  setMouse(style: MouseStyle): void {
    const turning = { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN };
    const moving = { LEFT: MOUSE.PAN, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.ROTATE };
    this.#controls.mouseButtons = style === 'foxglove' ? moving : turning;
    this.#controls.screenSpacePanning = style !== 'foxglove'; // there one moves over the floor
  }

  /** Goes along with a robot at (x, y) when it leaves the middle; the standing sway of a walk moves nothing. `yaw` is
   *  its heading, rad: with `turn` the eye keeps its side of the robot. */
  follow(x: number, y: number, yaw = 0): void {
    const turned = this.#yaw === null ? 0 : shorterTurn(yaw - this.#yaw);
    this.#yaw = yaw;
    if (this.followMode === 'stay') return;
    if (this.followMode === 'turn' && turned !== 0) {
      this.#ease.to.theta += turned;
      this.#ease.from.theta += turned;
      OFFSET.copy(this.camera.position).sub(this.#controls.target).applyAxisAngle(this.camera.up, turned);
      this.camera.position.copy(this.#controls.target).add(OFFSET);
      this.#controls.update();
    }
    const dx = x - this.#home.center.x;
    const dy = y - this.#home.center.y;
    const far = Math.hypot(dx, dy);
    const leash = this.#home.radius * LEASH;
    if (far <= leash) return;
    const part = 1 - leash / far;
    OFFSET.set(dx * part, dy * part, 0);
    this.#home.center.add(OFFSET);
    this.#ease.target.add(OFFSET);
    this.#controls.target.add(OFFSET);
    this.camera.position.add(OFFSET);
  }

  /** From the eye through a point of the picture (both −1…1, right and up). The same one every time. */
  ray({ x, y }: { readonly x: number; readonly y: number }): Ray {
    RAY.origin.setFromMatrixPosition(this.camera.matrixWorld);
    RAY.direction.set(x, y, 0.5).unproject(this.camera).sub(RAY.origin).normalize();
    return RAY;
  }

  /** The picture is so large, CSS px. */
  resize(width: number, height: number): void {
    this.#insets.resize(width, height);
    this.#fit();
    if (!this.#touched) this.look('home', false);
  }

  /** So much of the picture stands under notes and buttons: what is looked at comes to the middle of the rest. True when that is
   *  more or less than before. */
  cover(cover: Insets): boolean {
    const eased = !prefersReducedMotion();
    if (!this.#insets.setInsets(cover, eased)) return false;
    this.#fit();
    if (!this.#touched) this.look('home', eased);
    return true;
  }

  /** Moves on by so many seconds. True while more ticks are needed. */
  advance(seconds: number): boolean {
    if (this.#insets.moving) {
      this.#insets.advance(seconds);
      this.#fit();
    }
    if (this.#ease.left > 0) this.#step(seconds);
    return this.#ease.left > 0 || this.#insets.moving;
  }

  dispose(): void {
    this.#controls.dispose();
  }

  /** The whole of a view goes into the free part; the rest of the picture goes on around it. */
  #fit(): void {
    const { width, height, top, free } = this.#insets;
    this.camera.aspect = width / free;
    this.camera.setViewOffset(width, free, 0, -top, width, height);
  }

  #go(eased: boolean): void {
    this.#ease.left = EASE_SECONDS;
    if (!eased || prefersReducedMotion()) this.#step(Number.POSITIVE_INFINITY);
    else this.#step(0.001);
  }

  #grasp(): void {
    this.#touched = true;
    this.#placed = null;
    this.#ease.left = 0;
  }

  #step(seconds: number): void {
    const { from, to, target } = this.#ease;
    // Each step goes the part of the way that is left, weighted so that it slows down towards the end.
    const part = seconds >= this.#ease.left ? 1 : 1 - (1 - seconds / this.#ease.left) ** 2;
    this.#ease.left = Math.max(0, this.#ease.left - seconds);
    from.radius = MathUtils.lerp(from.radius, to.radius, part);
    from.phi = MathUtils.lerp(from.phi, to.phi, part);
    from.theta = MathUtils.lerp(from.theta, to.theta, part);
    this.#controls.target.lerp(target, part);
    const flat = from.radius * Math.sin(from.phi);
    OFFSET.set(flat * Math.cos(from.theta), flat * Math.sin(from.theta), from.radius * Math.cos(from.phi));
    this.camera.position.copy(this.#controls.target).add(OFFSET);
    this.#controls.update();
  }
}

const OFFSET = new Vector3();
const RAY = new Ray();

/** theta from x towards y, phi from z; three's own Spherical takes y for up. */
function zUpSpherical(offset: Vector3, into: Spherical): void {
  const radius = offset.length();
  into.set(
    radius,
    Math.acos(MathUtils.clamp(offset.z / (radius || 1), -1, 1)),
    Math.atan2(offset.y, offset.x),
  );
}

function shorterTurn(angle: number): number {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}
