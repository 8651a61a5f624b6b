import { type Extent, extentOf } from '../model/bounds.ts';
import type { EyePlace, FollowMode } from '../view/body_view.ts';
import { FIELD_OF_VIEW, fittingDistance, VIEWS, type ViewName } from '../view/framing.ts';
import { type Insets, ViewInsets } from '../view/insets.ts';

const EASE_SECONDS = 0.25;
const RADIANS = Math.PI / 180;
/** A full turn of the robot for a drag over the picture's height. */
const TURN_PER_HEIGHT = 2 * Math.PI;
/** The floor has no underside. */
const LOWEST = 0.5 * RADIANS;
const HIGHEST = 89.9 * RADIANS;
/** The eye goes along once the robot is this part of its own size off the middle. */
const LEASH = 0.3;
/** A link that is looked at closely fills the picture as if it were this part of the robot. */
const CLOSE_PART = 0.35;

type Vector = [number, number, number];

interface Stand {
  /** From the robot's x towards its y, rad. */
  azimuth: number;
  elevation: number;
  /** From what is looked at, metres. */
  distance: number;
  target: Vector;
}

/** The eye of the light view: the same words as the 3D view's camera (home, front, side, top; orbit, pan, zoom). World:
 *  Z up, metres; screen: pixels from the upper left corner. */
export class LightCamera {
  readonly #insets = new ViewInsets();
  #extent: Extent = { tall: 0.6, wide: 0.4, radius: 0.75 };
  #home: Vector = [0, 0, 0.6];
  #now: Stand;
  #goal: Stand | null = null;
  #left = 0;
  #touched = false;
  /** Taken from elsewhere, and kept until somebody moves the eye. */
  #placed: EyePlace | null = null;
  #yaw: number | null = null;
  /** The view that `home` means. */
  home: ViewName = 'home';
  followMode: FollowMode = 'along';

  constructor() {
    this.#now = this.#stand('home');
  }

  /** What of the world comes to which pixel: rows X, Y, W of 4 numbers; a point is seen at (X/W, Y/W), W metres away. */
  screenFromWorld(into = new Float64Array(12)): Float64Array {
    const { azimuth, elevation, distance, target } = this.#now;
    const [ca, sa] = [Math.cos(azimuth), Math.sin(azimuth)];
    const [ce, se] = [Math.cos(elevation), Math.sin(elevation)];
    const ahead: Vector = [-ce * ca, -ce * sa, -se];
    const right: Vector = [-sa, ca, 0];
    const up: Vector = [-se * ca, -se * sa, ce];
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

  /** Where the eye is in the world. */
  get position(): Readonly<Vector> {
    const { azimuth, elevation, distance, target } = this.#now;
    const flat = Math.cos(elevation) * distance;
    return [
      target[0] + flat * Math.cos(azimuth),
      target[1] + flat * Math.sin(azimuth),
      target[2] + Math.sin(elevation) * distance,
    ];
  }

  /** What it looks at. */
  get target(): Readonly<Vector> {
    return [...this.#now.target];
  }

  /** The middle of the robot over the floor, metres. */
  get middle(): { x: number; y: number } {
    return { x: this.#home[0], y: this.#home[1] };
  }

  /** On its way to another view. */
  get moving(): boolean {
    return this.#goal !== null || this.#insets.moving;
  }

  /** The radius of the robot that was framed, metres. */
  get reach(): number {
    return this.#extent.radius;
  }

  /** The picture is so large, CSS px. */
  resize(width: number, height: number): void {
    this.#insets.resize(width, height);
    if (!this.#touched) this.look('home', false);
  }

  /** So much of the picture stands under notes and buttons: what is looked at comes to the middle of the rest. True when that is
   *  more or less than before. */
  cover(cover: Insets, eased: boolean): boolean {
    if (!this.#insets.setInsets(cover, eased)) return false;
    if (!this.#touched) this.look('home', eased);
    return true;
  }

  /** Robots that fill this box. A view that somebody has chosen by hand stays. */
  frame(min: Readonly<Vector>, max: Readonly<Vector>, eased: boolean): void {
    this.#extent = extentOf(min, max);
    this.#home = [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, (min[2] + max[2]) / 2];
    if (this.#placed !== null) this.standAt(this.#placed);
    else if (!this.#touched) this.look('home', eased);
  }

  /** From the floor under the middle of the robot; null: the first view. */
  get stand(): EyePlace | null {
    if (!this.#touched) return null;
    const [x, y] = this.#home;
    const { position, target } = this;
    return {
      position: [position[0] - x, position[1] - y, position[2]],
      target: [target[0] - x, target[1] - y, target[2]],
    };
  }

  /** Stands there at once. */
  standAt(place: EyePlace): void {
    this.#grasp();
    this.#placed = place;
    const [x, y] = this.#home;
    const [dx, dy, dz] = place.position.map((metres, axis) => metres - place.target[axis]!) as Vector;
    const flat = Math.hypot(dx, dy);
    this.#now = {
      azimuth: Math.atan2(dy, dx),
      elevation: Math.min(HIGHEST, Math.max(LOWEST, Math.atan2(dz, flat))),
      distance: Math.hypot(flat, dz),
      target: [place.target[0] + x, place.target[1] + y, place.target[2]],
    };
  }

  look(view: ViewName, eased: boolean): void {
    this.#touched = view !== 'home';
    this.#placed = null;
    const goal = this.#stand(view);
    goal.azimuth = this.#now.azimuth + shorterTurn(goal.azimuth - this.#now.azimuth);
    this.#goal = goal;
    this.#left = EASE_SECONDS;
    if (!eased) this.advance(Number.POSITIVE_INFINITY);
  }

  /** Comes close to a point, metres. */
  focus(target: Readonly<Vector>, eased: boolean): void {
    this.#grasp();
    const distance = fittingDistance(this.#extent, this.#insets.aspect) * CLOSE_PART;
    this.#goal = { ...this.#now, distance, target: [...target] };
    this.#left = EASE_SECONDS;
    if (!eased) this.advance(Number.POSITIVE_INFINITY);
  }

  /** Goes along with a robot at (x, y), heading `yaw` rad, as `followMode` says. */
  follow(x: number, y: number, yaw = 0): void {
    const turned = this.#yaw === null ? 0 : shorterTurn(yaw - this.#yaw);
    this.#yaw = yaw;
    if (this.followMode === 'stay') return;
    if (this.followMode === 'turn') {
      this.#now.azimuth += turned;
      if (this.#goal !== null) this.#goal.azimuth += turned;
    }
    const [dx, dy] = [x - this.#home[0], y - this.#home[1]];
    const far = Math.hypot(dx, dy);
    const leash = this.#extent.radius * LEASH;
    if (far <= leash) return;
    const part = 1 - leash / far;
    for (const moved of [this.#home, this.#now.target, this.#goal?.target]) {
      if (moved === undefined) continue;
      moved[0] += dx * part;
      moved[1] += dy * part;
    }
  }

  /** A drag by so many pixels. */
  orbit(dx: number, dy: number): void {
    const turn = TURN_PER_HEIGHT / this.#insets.height;
    this.turn(dx * turn, dy * turn);
  }

  /** Around what is looked at, rad: to the left, and up. */
  turn(left: number, up: number): void {
    this.#grasp();
    this.#now.azimuth -= left;
    this.#now.elevation = Math.min(HIGHEST, Math.max(LOWEST, this.#now.elevation + up));
  }

  /** The world goes along with the pointer. */
  pan(dx: number, dy: number): void {
    this.#grasp();
    this.#shift(-dx, -dy, 1);
  }

  /** Comes nearer (factor below 1) to what is under the point, which is the middle if none is named. */
  zoom(factor: number, x = this.#centre.x, y = this.#centre.y): void {
    this.#grasp();
    const { radius } = this.#extent;
    const before = this.#now.distance;
    const after = Math.min(radius * 25, Math.max(radius / 2, before * factor));
    this.#shift(x - this.#centre.x, y - this.#centre.y, 1 - after / before);
    this.#now.distance = after;
  }

  /** Moves on by so many seconds. True while more are needed. */
  advance(seconds: number): boolean {
    if (this.#insets.moving) this.#insets.advance(seconds);
    const goal = this.#goal;
    if (goal === null) return this.moving;
    const part = seconds >= this.#left ? 1 : 1 - (1 - seconds / this.#left) ** 2;
    this.#left -= seconds;
    const mix = (from: number, to: number) => from + (to - from) * part;
    const now = this.#now;
    now.azimuth = mix(now.azimuth, goal.azimuth);
    now.elevation = mix(now.elevation, goal.elevation);
    now.distance = mix(now.distance, goal.distance);
    for (let i = 0; i < 3; i += 1) now.target[i] = mix(now.target[i]!, goal.target[i]!);
    if (part === 1) this.#goal = null;
    return this.moving;
  }

  /** Where what is looked at is seen, CSS px. */
  get #centre(): { x: number; y: number } {
    const { width, top, free } = this.#insets;
    return { x: width / 2, y: top + free / 2 };
  }

  get #scale(): number {
    return this.#insets.free / 2 / Math.tan((FIELD_OF_VIEW * RADIANS) / 2);
  }

  #grasp(): void {
    this.#touched = true;
    this.#placed = null;
    this.#goal = null;
  }

  /** Moves what is looked at by this part of so many pixels, at its own distance. */
  #shift(dx: number, dy: number, part: number): void {
    const { azimuth, elevation, distance, target } = this.#now;
    const metres = (distance / this.#scale) * part;
    const se = Math.sin(elevation);
    target[0] += metres * (-dx * Math.sin(azimuth) + dy * se * Math.cos(azimuth));
    target[1] += metres * (dx * Math.cos(azimuth) + dy * se * Math.sin(azimuth));
    target[2] += metres * (-dy * Math.cos(elevation));
  }

  #stand(view: ViewName): Stand {
    const { azimuth, elevation } = VIEWS[view === 'home' ? this.home : view];
    return {
      azimuth: azimuth * RADIANS,
      elevation: elevation * RADIANS,
      distance: fittingDistance(this.#extent, this.#insets.aspect),
      target: [...this.#home],
    };
  }
}

function dot(a: Readonly<Vector>, b: Readonly<Vector>): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function shorterTurn(angle: number): number {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}
