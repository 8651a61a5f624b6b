import { type Extent, extentOf } from '../../model/bounds.ts';
import type { PlacedBox } from '../../model/posed_body.ts';
import { addScaled, dot } from '../../model/vectors.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { clearDirection } from './clear_direction.ts';
import { directionOf, FIELD_OF_VIEW, fittingDistance, type ViewName } from './framing.ts';
import { type Insets, ViewInsets } from './insets.ts';
import {
  between,
  clamp,
  type EyePlace,
  type Orbit,
  orbitAt,
  positionOf,
  shifted,
  shorterTurn,
} from './orbit.ts';
import { type BodySpan, WholeBody } from './whole_body.ts';

/** Options that differ between renderers. */
export interface RigOptions {
  /** Minimum distance to the target, in radii of the robot; default `NEAREST`. */
  readonly nearest?: number;
  /** Maximum elevation of the camera, rad; default `HIGHEST`. */
  readonly highest?: number;
  /** Whether the viewer wants no motion, so that the camera jumps instead of easing. */
  readonly still?: () => boolean;
  /** Called when the camera has moved and a new picture is needed. */
  readonly changed?: () => void;
}

/** Default minimum distance of the camera from its target, in radii of the robot. */
const NEAREST = 1 / 8;
/** Minimum elevation of the camera, rad: it stays above the floor, which has no underside. */
export const LOWEST = (0.5 * Math.PI) / 180;
/** Default maximum elevation, rad: straight from above, the picture's up would be undefined. */
const HIGHEST = (89.9 * Math.PI) / 180;

/** A camera that was rotated (rad) or moved closer (as a fraction of its distance) by less than this does not count as moved: a
 *  clicking mouse slips by a pixel or two. */
const SLIP = 0.03;

/** The camera's position, and the reason for it. */
interface Stance {
  readonly orbit: Orbit;
  /** Whether the viewer had chosen the view. */
  readonly touched: boolean;
  /** Whether the distance was the one that fits the robot. */
  readonly fitted: boolean;
  /** The factor by which the body kept the camera farther away than when it was framed. */
  readonly growth: number;
  /** A place set by a link; null for none. */
  readonly placed: EyePlace | null;
}

/** A close view of a part of the robot, from which the camera can return to its previous position. */
class Visit {
  #before: Stance;
  #there: Orbit;

  constructor(before: Stance, there: Orbit) {
    this.#before = before;
    this.#there = there;
  }

  /** The camera's previous position. */
  get before(): Stance {
    return this.#before;
  }

  /** The robot has moved, and the camera's previous and current targets with it. */
  move(moved: (orbit: Orbit) => Orbit): void {
    this.#before = { ...this.#before, orbit: moved(this.#before.orbit) };
    this.#there = moved(this.#there);
  }

  /** Whether a camera in this position is still where the visit took it. */
  holds({ azimuth, elevation, distance, target }: Orbit): boolean {
    const there = this.#there;
    const off = Math.hypot(...target.map((metres, axis) => metres - there.target[axis]!));
    return [
      shorterTurn(azimuth - there.azimuth),
      elevation - there.elevation,
      distance / there.distance - 1,
      off / there.distance,
    ].every((part) => Math.abs(part) < SLIP);
  }
}

export type { EyePlace } from './orbit.ts';

/** How the camera reacts when the robot walks: it stays, moves along, or moves along and turns with it. */
export type FollowMode = 'stay' | 'along' | 'turn';

const RADIANS = Math.PI / 180;
const EASE_SECONDS = 0.25;
/** The camera follows once the robot is off centre by more than this fraction of its radius. */
const LEASH = 0.3;
/** Distance of a close view of a link, as a fraction of the distance that fits the whole robot. */
const CLOSE_PART = 0.35;
/** Maximum distance of the camera from its target, in radii of the robot. */
const FARTHEST = 25;

/**
 * The camera of all views, independent of the renderer: it orbits, frames the robot, eases between named views, and
 * follows a walking robot. World: Z up, metres; angles: rad; picture: CSS px from its upper left corner.
 */
export class CameraRig {
  /** The view behind `home`. */
  home: ViewName = 'home';
  followMode: FollowMode = 'along';
  readonly #options: Required<RigOptions>;
  readonly #insets = new ViewInsets();
  readonly #whole = new WholeBody();
  #extent: Extent = { tall: 0.6, wide: 0.4, radius: 0.75 };
  /** The middle of the framed robot, moved along with it since. */
  #middle: Vec3 = [0, 0, 0.6];
  #now: Orbit;
  #goal: Orbit | null = null;
  #secondsLeft = 0;
  /** Whether the viewer has chosen the view; it is then independent of the robot's or the picture's size. */
  #touched = false;
  /** Whether the distance is the one that fits the robot; it then grows with the robot. */
  #fitted = true;
  /** The body at the newest `follow`. */
  #body: BodySpan | null = null;
  /** A place set by `standAt`, applied again when the robot is reframed, until the viewer moves the camera. */
  #placed: EyePlace | null = null;
  /** The newest `visit` that has not been reversed. */
  #visit: Visit | null = null;
  #yaw: number | null = null;

  constructor(options: RigOptions = {}) {
    const { nearest = NEAREST, highest = HIGHEST, still = () => false, changed = () => {} } = options;
    this.#options = { nearest, highest, still, changed };
    this.#now = this.#orbitOf('home');
  }

  /** The camera's position. */
  get position(): Vec3 {
    return positionOf(this.#now);
  }

  /** The camera's target. */
  get target(): Vec3 {
    return this.#now.target;
  }

  get eye(): EyePlace {
    return { position: this.position, target: this.target };
  }

  /** The place relative to the floor under the robot's middle; null until the viewer chooses a view. */
  get stand(): EyePlace | null {
    if (!this.#touched) return null;
    const floor: Vec3 = [this.#middle[0], this.#middle[1], 0];
    return { position: addScaled(this.position, floor, -1), target: addScaled(this.target, floor, -1) };
  }

  /** The robot's middle, projected to the floor, and its height above its standing position. */
  get middle(): { readonly x: number; readonly y: number; readonly flies: number } {
    const [x, y, z] = this.#middle;
    return { x, y, flies: Math.max(0, z - this.#extent.tall) };
  }

  /** The radius of the framed robot. */
  get reach(): number {
    return this.#extent.radius;
  }

  /** The minimum and maximum distance from the target. */
  get distances(): { readonly least: number; readonly greatest: number } {
    const { radius } = this.#extent;
    const greatest = radius * FARTHEST * this.#whole.growth;
    return { least: radius * this.#options.nearest, greatest };
  }

  /** The parameters of a perspective camera: the picture's size; its uncovered part, which begins at `top` and is
   *  `free` high (CSS px), and to which `FIELD_OF_VIEW` applies; and the clipping distances `near` and `far` (metres).
   *  */
  get projection(): Readonly<Record<'width' | 'height' | 'top' | 'free' | 'near' | 'far', number>> {
    const { width, height, top, free } = this.#insets;
    const { radius } = this.#extent;
    const far = radius * 120 * this.#whole.growth + this.middle.flies * 12; // as far as the floor is visible
    return { width, height, top, free, near: radius / 100, far };
  }

  /** Whether it is easing to another view. */
  get moving(): boolean {
    return this.#goal !== null || this.#insets.moving;
  }

  /** The projection from world to picture as three rows X, Y, W of 4 numbers: a point appears at (X/W, Y/W) CSS px, at
   *  a depth of W metres. */
  screenFromWorld(into = new Float64Array(12)): Float64Array {
    const { azimuth, elevation, distance, target } = this.#now;
    const [ca, sa] = [Math.cos(azimuth), Math.sin(azimuth)];
    const [ce, se] = [Math.cos(elevation), Math.sin(elevation)];
    const ahead: Vec3 = [-ce * ca, -ce * sa, -se];
    const right: Vec3 = [-sa, ca, 0];
    const up: Vec3 = [-se * ca, -se * sa, ce];
    const scale = this.#scale;
    const { x, y } = this.#centre;
    const away = distance - dot(ahead, target);
    for (let i = 0; i < 3; i += 1) {
      into[i] = right[i]! * scale + ahead[i]! * x;
      into[4 + i] = -up[i]! * scale + ahead[i]! * y;
      into[8 + i] = ahead[i]!;
    }
    into[3] = -dot(right, target) * scale + away * x;
    into[7] = dot(up, target) * scale + away * y;
    into[11] = away;
    return into;
  }

  /** Sets the picture's size, CSS px. */
  resize(width: number, height: number): void {
    this.#insets.resize(width, height);
    if (this.#touched) this.#options.changed();
    else this.look('home', false);
  }

  /** Sets how much of the picture is covered by notes and buttons; the target moves to the middle of the rest. */
  cover(cover: Insets): void {
    if (!this.#insets.setInsets(cover, !this.#options.still())) return;
    if (this.#touched) this.#options.changed();
    else this.look('home');
  }

  /** Frames robots that fill this box. The target is its middle, roughly at the pelvis of a standing robot. A view chosen by the
   *  viewer stays. */
  frame(min: Vec3, max: Vec3, eased = false): void {
    this.#extent = extentOf(min, max);
    this.#middle = [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, (min[2] + max[2]) / 2];
    this.#whole.frame(this.#extent, this.#middle[2]);
    this.#body = null;
    if (this.#placed !== null) this.standAt(this.#placed);
    else if (this.#touched) this.#options.changed();
    else this.look('home', eased);
  }

  /** Moves at once to a place relative to the floor under the robot's middle. */
  standAt(place: EyePlace): void {
    this.grasp();
    this.#placed = place;
    const floor: Vec3 = [this.#middle[0], this.#middle[1], 0];
    const { least, greatest } = this.distances;
    const { distance, ...orbit } = orbitAt({
      position: addScaled(place.position, floor),
      target: addScaled(place.target, floor),
    });
    this.#now = {
      ...orbit,
      elevation: this.#tilted(orbit.elevation),
      distance: clamp(distance, least, greatest),
    };
    this.#options.changed();
  }

  /** Turns to a named view around the robot's current position. */
  look(view: ViewName, eased = true): void {
    this.#touched = view !== 'home';
    this.#fitted = true;
    this.#placed = null;
    this.#whole.shrink();
    const { aspect, finalFree } = this.#insets;
    if (this.#body !== null) this.#whole.correct(this.#body, this.#middle, aspect, finalFree);
    this.#turnTo(this.#orbitOf(view), eased);
  }

  /** Moves close to a point of the world. */
  focus(target: Vec3, eased = true): void {
    this.grasp();
    this.#go({ ...this.#now, distance: this.#closeDistance, target }, eased);
  }

  /** Moves close to a point of the world, and around it to where `hiding` hides it least; `goBack` reverses this. */
  visit(target: Vec3, hiding: Iterable<PlacedBox>, eased = true): void {
    const stands = this.#goal ?? this.#now;
    const [touched, fitted, placed] = [this.#touched, this.#fitted, this.#placed];
    const now = { orbit: stands, touched, fitted, placed, growth: this.#whole.growth };
    const before = this.#visit?.holds(stands) === true ? this.#visit.before : now;
    const from = { ...stands, distance: this.#closeDistance, target };
    const sight = { from, reach: this.reach, lowest: LOWEST, highest: this.#options.highest };
    const there = { ...from, ...clearDirection(target, hiding, sight) };
    this.grasp();
    this.#visit = new Visit(before, there);
    this.#turnTo(there, eased);
  }

  /** Moves back to where it was before `visit`; stays if the viewer has moved it since. */
  goBack(eased = true): void {
    const visit = this.#visit;
    this.#visit = null;
    if (visit?.holds(this.#goal ?? this.#now) !== true) return;
    const { orbit, touched, fitted, growth, placed } = visit.before;
    this.#touched = touched;
    this.#fitted = fitted;
    this.#placed = placed;
    const grown = fitted ? this.#whole.growth / growth : 1;
    // if the viewer had not chosen the view, the size of the picture or the robot may have changed
    const { distance, target } = touched
      ? { ...orbit, distance: orbit.distance * grown }
      : this.#orbitOf('home');
    this.#turnTo({ ...orbit, distance, target }, eased);
  }

  /** The viewer takes over the camera: any easing ends. */
  grasp(): void {
    this.#touched = true;
    this.#fitted = false;
    this.#placed = null;
    this.#goal = null;
  }

  /** Takes a place that the viewer chose with other controls, which have applied the limits. */
  hold(place: EyePlace): void {
    this.grasp();
    this.#now = orbitAt(place);
    this.#options.changed();
  }

  /** Turns the camera around its target, rad: to the left, and up. */
  orbit(left: number, up: number): void {
    this.grasp();
    const { azimuth, elevation } = this.#now;
    this.#now = { ...this.#now, azimuth: azimuth - left, elevation: this.#tilted(elevation + up) };
    this.#options.changed();
  }

  /** Turns with a pointer's motion: one picture height is a full turn. */
  drag(dx: number, dy: number): void {
    const turn = (2 * Math.PI) / this.#insets.height;
    this.orbit(dx * turn, dy * turn);
  }

  /** Pans the world with a pointer that moved by this many pixels. */
  pan(dx: number, dy: number): void {
    this.grasp();
    this.#shift(-dx, -dy, 1);
    this.#options.changed();
  }

  /** Scales the distance (factor below 1: closer) towards a point of the picture, by default its middle. */
  zoom(factor: number, x = this.#centre.x, y = this.#centre.y): void {
    this.grasp();
    const { least, greatest } = this.distances;
    const before = this.#now.distance;
    const distance = clamp(before * factor, least, greatest);
    this.#shift(x - this.#centre.x, y - this.#centre.y, 1 - distance / before);
    this.#now = { ...this.#now, distance };
    this.#options.changed();
  }

  /** Follows a robot at (x, y) when it leaves the middle; the slight sway of a walk does not move the camera. `yaw` is the
   *  robot's heading: in mode `turn`, the camera keeps to the same side of the robot. The whole `body` is kept in the picture,
   *  whatever it does; a distance chosen by the viewer stays. */
  follow(x: number, y: number, yaw = 0, body: BodySpan | null = null): void {
    const turned = this.#yaw === null ? 0 : shorterTurn(yaw - this.#yaw);
    this.#yaw = yaw;
    this.#body = body;
    if (this.followMode === 'stay') return;
    const turn = this.followMode === 'turn' ? turned : 0;
    const [dx, dy] = [x - this.#middle[0], y - this.#middle[1]];
    const far = Math.hypot(dx, dy);
    const leash = this.#extent.radius * LEASH;
    const part = far <= leash ? 0 : 1 - leash / far;
    this.#move(turn, [dx * part, dy * part, 0], 1);
    if (body === null) return;
    const { aspect, finalFree } = this.#insets;
    const { step, growth } = this.#whole.correct(body, this.#middle, aspect, finalFree);
    this.#move(0, step, this.#fitted ? growth : 1);
  }

  /** Advances the easing. True while it needs more time. */
  advance(seconds: number): boolean {
    if (!this.moving) return false;
    if (this.#insets.moving) this.#insets.advance(seconds);
    if (this.#goal !== null) this.#approach(this.#goal, seconds);
    this.#options.changed();
    return this.moving;
  }

  /** Where the target appears in the picture. */
  get #centre(): { readonly x: number; readonly y: number } {
    const { width, top, free } = this.#insets;
    return { x: width / 2, y: top + free / 2 };
  }

  /** Pixels per metre at a distance of one metre. */
  get #scale(): number {
    return this.#insets.free / 2 / Math.tan((FIELD_OF_VIEW * RADIANS) / 2);
  }

  /** Moves the camera and its easing target: around the robot by `turn` (rad), along with it by `step` (metres), and away from it
   *  by a factor. */
  #move(turn: number, step: Vec3, farther: number): void {
    if (turn === 0 && farther === 1 && step.every((metres) => metres === 0)) return;
    const moved = (orbit: Orbit): Orbit => ({
      ...orbit,
      azimuth: orbit.azimuth + turn,
      distance: orbit.distance * farther,
      target: addScaled(orbit.target, step),
    });
    this.#middle = addScaled(this.#middle, step);
    this.#now = moved(this.#now);
    this.#goal &&= moved(this.#goal);
    this.#visit?.move(moved);
    this.#options.changed();
  }

  /** The distance from which the framed robot fits the picture. */
  get #fitting(): number {
    const { aspect, finalFree } = this.#insets;
    return fittingDistance(this.#extent, aspect, finalFree);
  }

  /** The distance for a close view of a link. */
  get #closeDistance(): number {
    return this.#fitting * CLOSE_PART;
  }

  /** Goes to an orbit the shorter way round. */
  #turnTo(goal: Orbit, eased: boolean): void {
    const azimuth = this.#now.azimuth + shorterTurn(goal.azimuth - this.#now.azimuth);
    this.#go({ ...goal, azimuth }, eased);
  }

  #go(goal: Orbit, eased: boolean): void {
    this.#goal = goal;
    this.#secondsLeft = EASE_SECONDS;
    if (!eased || this.#options.still()) this.#approach(goal, Number.POSITIVE_INFINITY);
    this.#options.changed();
  }

  /** Moves part of the remaining way, so that the motion is an ease-out whatever the frame rate. */
  #approach(goal: Orbit, seconds: number): void {
    const part = seconds >= this.#secondsLeft ? 1 : 1 - (1 - seconds / this.#secondsLeft) ** 2;
    this.#secondsLeft -= seconds;
    this.#now = between(this.#now, goal, part);
    if (part === 1) this.#goal = null;
  }

  /** Moves the target in the picture plane by `part` of (dx, dy) pixels, measured at its distance. */
  #shift(dx: number, dy: number, part: number): void {
    const metres = (this.#now.distance / this.#scale) * part;
    this.#now = shifted(this.#now, metres * dx, metres * dy);
  }

  #tilted(elevation: number): number {
    return clamp(elevation, LOWEST, this.#options.highest);
  }

  #orbitOf(view: ViewName): Orbit {
    const { azimuth, elevation } = directionOf(view === 'home' ? this.home : view, this.#extent);
    return {
      azimuth: azimuth * RADIANS,
      elevation: elevation * RADIANS,
      distance: Math.min(this.#fitting * this.#whole.growth, this.distances.greatest),
      target: this.#middle,
    };
  }
}
