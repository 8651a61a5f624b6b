import type { Balance, FootBalance } from './balance.ts';
import { follows } from './centre_velocity.ts';

/** How far back the trace and the footprints go, seconds. */
export const TRACK_S = 10;
/** Most points of the trace; with more poses than that in ten seconds some are left out. */
const POINTS_MAX = 600;
const FOOTPRINTS_MAX = 64;
/** A sole is taken as flat again when its corners' heights differ by at most so much more than at their best, metres. */
const FLAT_M = 0.002;

type Triple = [number, number, number];

/** Where a foot stood. */
export interface Footprint {
  /** The foot's name, as in `FootBalance`. */
  readonly foot: string;
  /** Its sole's corners while it stood flattest (world of the newest pose, metres). */
  readonly corners: readonly (readonly [x: number, y: number, z: number])[];
  /** When it began to bear, and when it stopped (seconds); null while it bears. */
  readonly fromS: number;
  untilS: number | null;
}

interface Print extends Footprint {
  readonly corners: readonly Triple[];
  spreadM: number;
}

/** Where a foot is on the floor: its first corner, and the direction to the one farthest from it. */
interface Place {
  bore: boolean;
  x: number;
  y: number;
  headingX: number;
  headingY: number;
}

/**
 * The trace of the centre of mass on the floor, and the footprints, of the last ten seconds.
 *
 * Both lie in the world of the newest pose. A robot that reports its base moves through that world by its odometry. Any
 * other stays at its origin: then what was before is moved by the way that a foot which bears seems to have made, since
 * it is the foot that stood and the world that slid. Where no foot bears in two poses in turn nothing of the kind is
 * known, and the track begins anew, as it does after a gap of 0.75 s.
 */
export class BalanceTrack {
  /** The trace: x, y, z (world, metres), oldest first; the first `count` points hold. */
  readonly points = new Float64Array(3 * POINTS_MAX);
  /** The time of each point, seconds. */
  readonly times = new Float64Array(POINTS_MAX);
  count = 0;
  readonly #prints: Print[] = [];
  #places: Place[] = [];
  #tS = Number.NaN;

  /** Oldest first. */
  get footprints(): readonly Footprint[] {
    return this.#prints;
  }

  /** Takes the next pose. `byOdometry`: its world is that of the robot's odometry, with its true heading. */
  push(balance: Balance, tS: number, byOdometry: boolean): void {
    if (!follows(this.#tS, tS)) this.clear();
    // Where it is not known which feet bear, the pose is left out.
    if (tS === this.#tS || balance.feet.some(({ bears }) => bears === null)) return;
    if (!byOdometry && !this.#slide(balance.feet)) this.clear();
    this.#tS = tS;
    this.#takeFeet(balance.feet, tS);
    this.#takeCentre(balance, tS);
    this.#drop(tS - TRACK_S);
  }

  clear(): void {
    this.count = 0;
    this.#prints.length = 0;
    this.#places = [];
    this.#tS = Number.NaN;
  }

  /** Moves all that was before by the way that a foot seems to have made since the last pose. False when no foot bore
   *  then and bears now. */
  #slide(feet: readonly FootBalance[]): boolean {
    let shared = -1;
    for (let i = 0; i < feet.length; i += 1) {
      if (feet[i]!.bears !== true || this.#places[i]?.bore !== true) continue;
      if (shared < 0 || (feet[i]!.forceN ?? 0) > (feet[shared]!.forceN ?? 0)) shared = i;
    }
    if (shared < 0) return this.count === 0 && this.#prints.length === 0;
    const before = this.#places[shared]!;
    const now = placeOf(feet[shared]!);
    const cos = before.headingX * now.headingX + before.headingY * now.headingY;
    const sin = before.headingX * now.headingY - before.headingY * now.headingX;
    const move = (at: Float64Array | Triple, i: number) => {
      const [x, y] = [at[i]! - before.x, at[i + 1]! - before.y];
      at[i] = now.x + cos * x - sin * y;
      at[i + 1] = now.y + sin * x + cos * y;
    };
    for (let i = 0; i < this.count; i += 1) move(this.points, 3 * i);
    for (const { corners } of this.#prints) for (const corner of corners) move(corner, 0);
    return true;
  }

  #takeFeet(feet: readonly FootBalance[], tS: number): void {
    this.#places = feet.map((foot) => {
      const bears = foot.bears === true;
      let print = this.#prints.findLast((one) => one.foot === foot.name && one.untilS === null);
      if (!bears) {
        if (print !== undefined) print.untilS = tS;
      } else {
        if (print === undefined) {
          print = {
            ...{ foot: foot.name, corners: foot.corners.map((): Triple => [0, 0, 0]), fromS: tS },
            ...{ untilS: null, spreadM: Number.POSITIVE_INFINITY },
          };
          this.#prints.push(print);
        }
        press(print, foot);
      }
      return { ...placeOf(foot), bore: bears };
    });
  }

  #takeCentre({ centreOfMass, floorM }: Balance, tS: number): void {
    if (centreOfMass === null || floorM === null) return;
    // At most as many points as fit into ten seconds.
    const newest = this.count === 0 ? Number.NEGATIVE_INFINITY : this.times[this.count - 1]!;
    if (tS - newest < TRACK_S / POINTS_MAX) return;
    if (this.count === POINTS_MAX) this.#dropPoints(1);
    this.points[3 * this.count] = centreOfMass[0];
    this.points[3 * this.count + 1] = centreOfMass[1];
    this.points[3 * this.count + 2] = floorM;
    this.times[this.count] = tS;
    this.count += 1;
  }

  /** Drops what was over before a time, and the oldest footprints when there are too many. */
  #drop(beforeS: number): void {
    let old = 0;
    while (old < this.count && this.times[old]! < beforeS) old += 1;
    if (old > 0) this.#dropPoints(old);
    for (let i = this.#prints.length - 1; i >= 0; i -= 1) {
      const { untilS } = this.#prints[i]!;
      if (untilS !== null && untilS < beforeS) this.#prints.splice(i, 1);
    }
    while (this.#prints.length > FOOTPRINTS_MAX) this.#prints.shift();
  }

  #dropPoints(old: number): void {
    this.points.copyWithin(0, 3 * old, 3 * this.count);
    this.times.copyWithin(0, old, this.count);
    this.count -= old;
  }
}

/** Takes the foot's corners where it stands as flat as it did, or flatter. */
function press(print: Print, { corners }: FootBalance): void {
  let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (const [, , z] of corners) {
    low = Math.min(low, z);
    high = Math.max(high, z);
  }
  const spread = high - low;
  if (!(spread <= print.spreadM + FLAT_M)) return;
  print.spreadM = Math.min(print.spreadM, spread);
  corners.forEach((corner, i) => {
    for (let axis = 0; axis < 3; axis += 1) print.corners[i]![axis] = corner[axis]!;
  });
}

function placeOf({ corners }: FootBalance): Place {
  const [x = 0, y = 0] = corners[0] ?? [];
  let [headingX, headingY] = [1, 0];
  let most = 0;
  for (const corner of corners) {
    const length = Math.hypot(corner[0] - x, corner[1] - y);
    if (length <= most) continue;
    most = length;
    [headingX, headingY] = [(corner[0] - x) / length, (corner[1] - y) / length];
  }
  return { bore: false, x, y, headingX, headingY };
}
