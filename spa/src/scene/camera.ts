import { type Box3, MathUtils, PerspectiveCamera, Sphere, Spherical, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { wantsStillness } from './motion.ts';

export type ViewName = 'home' | 'front' | 'side' | 'top';

const FIELD_OF_VIEW = 30; // long enough a lens that a robot keeps its proportions; Hubo fits from about 3 m
/** Empty space around the robot, in heights and in widths: arms come out to the sides. */
const AIR_TALL = 1.22;
const AIR_WIDE = 1.3;
const EASE_SECONDS = 0.25;
/** The camera goes along once the robot is this part of its own size off the middle. */
const LEASH = 0.3;

/** Where the eye stands, seen from what it looks at: azimuth from the robot's x (ahead) towards its y (left). */
const VIEWS: Readonly<Record<ViewName, { azimuth: number; elevation: number }>> = {
  home: { azimuth: -45, elevation: 14 },
  front: { azimuth: 0, elevation: 4 },
  side: { azimuth: -90, elevation: 4 },
  // Not quite from above: there the screen's up would be undefined. Ahead is up.
  top: { azimuth: 180, elevation: 89.9 },
};

/** The eye, in a world whose Z is up: orbits, eases between named views, and goes along with a walking robot. */
export class CameraRig {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
  readonly #controls: OrbitControls;
  readonly #home = new Sphere(new Vector3(0, 0, 0.6), 0.75);
  /** Half of the robot's height, and of its width seen from any side; metres. */
  #tall = 0.6;
  #wide = 0.4;
  readonly #ease = { from: new Spherical(), to: new Spherical(), target: new Vector3(), left: 0 };
  #touched = false;

  /** `onChange`: a new picture is wanted. */
  constructor(canvas: HTMLElement, onChange: () => void) {
    this.camera.up.set(0, 0, 1); // before the controls: they read it once
    this.#controls = new OrbitControls(this.camera, canvas);
    // No inertia: it is counted in frames, so on a slow machine the view would swim behind the hand.
    this.#controls.maxPolarAngle = MathUtils.degToRad(89.5); // the floor has no underside
    this.#controls.zoomToCursor = true;
    this.#controls.addEventListener('start', () => {
      this.#touched = true;
      this.#ease.left = 0;
      onChange();
    });
    this.#controls.addEventListener('change', onChange);
    this.look('home', false);
  }

  /** What the eye looks at, metres. */
  get target(): Readonly<Vector3> {
    return this.#controls.target;
  }

  /** The radius of the robot that was framed, metres. */
  get reach(): number {
    return this.#home.radius;
  }

  /** A robot that fills this box: looked at in its middle, which is about where a standing robot's pelvis is. A view
   *  that somebody has chosen by hand stays. */
  frame(box: Box3, eased = false): void {
    box.getBoundingSphere(this.#home);
    this.#home.radius = MathUtils.clamp(this.#home.radius, 0.02, 200);
    this.#tall = (box.max.z - box.min.z) / 2;
    this.#wide = Math.hypot(box.max.x - box.min.x, box.max.y - box.min.y) / 2;
    const { radius } = this.#home;
    this.camera.near = radius / 100;
    this.camera.far = radius * 120;
    this.#controls.minDistance = radius / 8;
    this.#controls.maxDistance = radius * 25;
    this.camera.updateProjectionMatrix();
    if (!this.#touched) this.look('home', eased);
  }

  /** Turns to a named view around where the robot now is. */
  look(view: ViewName, eased = true): void {
    const { azimuth, elevation } = VIEWS[view];
    this.#touched = view !== 'home';
    const { from, to, target } = this.#ease;
    target.copy(this.#home.center);
    to.set(this.#fittingDistance(), MathUtils.degToRad(90 - elevation), MathUtils.degToRad(azimuth));
    zUpSpherical(OFFSET.copy(this.camera.position).sub(this.#controls.target), from);
    to.theta = from.theta + shorterTurn(to.theta - from.theta);
    this.#ease.left = EASE_SECONDS;
    if (!eased || wantsStillness()) this.#step(Number.POSITIVE_INFINITY);
    else this.#step(0.001);
  }

  /** Goes along with a robot at (x, y) when it leaves the middle; the standing sway of a walk moves nothing. */
  follow(x: number, y: number): void {
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

  resize(width: number, height: number): void {
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (!this.#touched) this.look('home', false);
  }

  /** Moves on by so many seconds. True while more ticks are needed. */
  advance(seconds: number): boolean {
    if (this.#ease.left > 0) this.#step(seconds);
    return this.#ease.left > 0;
  }

  dispose(): void {
    this.#controls.dispose();
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

  /** From where the whole robot is in the picture, also in an upright phone's. */
  #fittingDistance(): number {
    const slope = Math.tan(MathUtils.degToRad(FIELD_OF_VIEW) / 2);
    const byHeight = (this.#tall * AIR_TALL) / slope;
    const byWidth = (this.#wide * AIR_WIDE) / (slope * this.camera.aspect);
    return Math.max(byHeight, byWidth, this.#home.radius * 2) + this.#wide / 2;
  }
}

const OFFSET = new Vector3();

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
