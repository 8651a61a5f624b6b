import { Arrivals, type Stamp } from './arrivals.ts';

/** How the numbers of a state are interpolated: wrapping angles and quaternions are listed here; all others are lengths or angles
 *  with linear interpolation. */
export interface Layout {
  readonly size: number;
  /** Indices of angles (rad) of continuous joints, which wrap: from 3 to -3 the way leads over π. */
  readonly wraps: ReadonlySet<number>;
  /** Indices at which a unit quaternion w, x, y, z begins. */
  readonly quats: readonly number[];
}

/** Maximum number of moves waiting to be played; beyond that the oldest is skipped. */
export const MOST_MOVES = 32;
/** After a longer gap between frames, the motion in between is unknown: the newest frame is shown at once. */
export const GAP_MS = 1000;
/** To correct its position, the playhead runs faster or slower than the clock by at most this fraction. */
const SLEW = 0.1;
/** If it is off by more than this, the playhead jumps. */
const LOST_MS = 500;
const LEAST_CATCH_UP_MS = 16;

interface Move {
  fromMs: number;
  toMs: number;
  readonly goal: Float64Array;
  /** Robot time of both ends, seconds. */
  readonly fromS: number;
  readonly toS: number;
}

/**
 * Interpolates between the frames of one stream, so that ten poses a second look like continuous motion. It never extrapolates:
 * if no newer pose has arrived, it holds the last one.
 *
 * The playhead runs `delayMs` behind the earliest time at which frames can arrive. After a frame that arrives later than that, it
 * catches up within half an interval; of several late frames only the newest counts. So lateness never accumulates.
 */
export class Playout {
  readonly #layout: Layout;
  #raw = false;
  #arrivals = new Arrivals();
  #newest: Stamp | null = null;
  #moves: Move[] = [];
  /** The values at the start of the first move. */
  #from: Float64Array | null = null;
  #fromS = Number.NaN;
  #shown: Float64Array;
  #shownS = Number.NaN;
  #newestGoal: Float64Array | null = null;
  #headMs = Number.NaN;
  #headAtMs = 0;

  constructor(layout: Layout) {
    this.#layout = layout;
    this.#shown = new Float64Array(layout.size).fill(Number.NaN);
  }

  /** If true, shows each frame on arrival, without delay or interpolation. */
  set raw(raw: boolean) {
    this.#raw = raw;
    if (raw && this.#newestGoal !== null) this.#jump(this.#newestGoal, this.#newest!.tS);
  }

  /** The values to show after the newest `sample` or `push`; NaN where nothing was ever read. Always the same array. */
  get shown(): Float64Array {
    return this.#shown;
  }

  /** Robot time of `shown`, seconds; NaN before the first. */
  get shownS(): number {
    return this.#shownS;
  }

  /** The current delay, ms, behind the earliest moment at which frames can arrive. */
  get delayMs(): number {
    return this.#raw || this.#newest === null ? 0 : this.#arrivals.delayMs;
  }

  /** The number of waiting moves; for tests. */
  get waiting(): number {
    return this.#moves.length;
  }

  /** Takes a frame's values (copied; NaN is no reading and keeps the last value). True when a new picture may be
   *  needed. */
  push(stamp: Stamp, values: ArrayLike<number>): boolean {
    const before = this.#newest;
    if (before !== null && stamp.seq === before.seq && stamp.tS === before.tS) return false; // repeated after rejoining
    const backwards = before !== null && (stamp.tS <= before.tS || stamp.seq <= before.seq);
    // from a delayed stream to one without delay: the statistics of the arrivals no longer apply
    const leaps = before !== null && (stamp.tS - before.tS) * 1000 - (stamp.atMs - before.atMs) > GAP_MS;
    if (backwards || leaps) this.#arrivals = new Arrivals();
    this.#newest = stamp;
    const goal = this.#complete(values);
    const known = this.#newestGoal;
    const moves = known === null || goal.some((value, i) => !Object.is(value, known[i]));
    this.#newestGoal = goal;
    const { lineMs, moveMs } = this.#arrivals.add(stamp, moves);
    const gap = before === null || backwards || leaps || stamp.atMs - before.atMs > GAP_MS;
    if (gap || this.#raw) return this.#jump(goal, stamp.tS) || moves;
    if (!moves) {
      if (this.#moves.length === 0) this.#fromS = this.#shownS = stamp.tS;
      return false;
    }
    this.#move(goal, stamp.tS, lineMs, moveMs, this.#playhead(stamp.atMs));
    return true;
  }

  /** Advances to `nowMs` of the viewer's clock. True while more motion is waiting to be played. */
  sample(nowMs: number): boolean {
    if (this.#from === null) return false;
    const headMs = this.#playhead(nowMs);
    for (let next = this.#moves[0]; next !== undefined && next.toMs <= headMs; next = this.#moves[0]) {
      this.#from = next.goal;
      this.#fromS = next.toS;
      this.#moves.shift();
    }
    const move = this.#moves[0];
    if (move === undefined || headMs <= move.fromMs) {
      this.#shown.set(this.#from);
      this.#shownS = this.#fromS;
    } else {
      const part = (headMs - move.fromMs) / (move.toMs - move.fromMs);
      blend(this.#layout, this.#from, move.goal, part, this.#shown);
      this.#shownS = move.fromS + part * (move.toS - move.fromS);
    }
    return move !== undefined;
  }

  #complete(values: ArrayLike<number>): Float64Array {
    const known = this.#newestGoal;
    return Float64Array.from(values, (value, i) =>
      Number.isFinite(value) ? value : (known?.[i] ?? Number.NaN),
    );
  }

  #jump(goal: Float64Array, tS: number): boolean {
    const before = this.#shown.slice();
    this.#moves = [];
    this.#from = goal;
    this.#fromS = this.#shownS = tS;
    this.#shown.set(goal);
    this.#headMs = Number.NaN;
    return before.some((value, i) => !Object.is(value, goal[i]));
  }

  #move(goal: Float64Array, toS: number, lineMs: number, moveMs: number, headMs: number): void {
    const catchUpMs = Math.max(LEAST_CATCH_UP_MS, this.#arrivals.intervalMs / 2);
    if (lineMs < headMs + catchUpMs) {
      // Late: go straight from the displayed values to this frame, and drop the moves still waiting.
      this.#from = this.#shown.slice();
      this.#fromS = this.#shownS;
      this.#moves = [{ fromMs: headMs, toMs: headMs + catchUpMs, goal, fromS: this.#fromS, toS }];
      return;
    }
    const busyMs = this.#moves.at(-1)?.toMs ?? headMs;
    const fromMs = Math.max(
      lineMs - Math.min(moveMs, this.#arrivals.delayMs),
      headMs,
      Math.min(busyMs, lineMs - 1),
    );
    // it stood still since the last move ended
    const fromS = Math.max(this.#moves.at(-1)?.toS ?? this.#fromS, toS - (lineMs - fromMs) / 1000);
    this.#moves.push({ fromMs, toMs: lineMs, goal, fromS, toS });
    if (this.#moves.length <= MOST_MOVES) return;
    const skipped = this.#moves.shift()!;
    this.#from = skipped.goal;
    this.#fromS = skipped.toS;
  }

  /** The picture's time on the stream's time line at `nowMs`. Small errors are corrected slowly, large ones by a jump.
   *  */
  #playhead(nowMs: number): number {
    const wanted = nowMs - this.#arrivals.offsetMs - this.#arrivals.delayMs;
    const passedMs = Math.max(0, nowMs - this.#headAtMs);
    const off = wanted - (this.#headMs + passedMs);
    // headMs is NaN at first, which takes the second branch.
    if (Math.abs(off) <= LOST_MS) this.#headMs += passedMs + clamp(off, SLEW * passedMs);
    else this.#headMs = wanted;
    this.#headAtMs = Math.max(nowMs, this.#headAtMs);
    return this.#headMs;
  }
}

function clamp(value: number, most: number): number {
  return Math.min(most, Math.max(-most, value));
}

const TURN = 2 * Math.PI;
/** Above this cosine the orientations are nearly equal: linear interpolation is as good and avoids a division by zero.
 *  */
const STRAIGHT = 0.9995;

/** Writes to `into` the state at `part` (0…1) of the way from `from` to `to`. A value that is NaN in either is taken
 *  from `to`. */
export function blend(
  { wraps, quats }: Layout,
  from: Float64Array,
  to: Float64Array,
  part: number,
  into: Float64Array,
): void {
  for (let i = 0; i < to.length; i += 1) {
    const a = from[i]!;
    const b = to[i]!;
    if (Number.isNaN(a) || Number.isNaN(b)) into[i] = b;
    else if (wraps.has(i)) into[i] = a + shorterArc(b - a) * part;
    else into[i] = a + (b - a) * part;
  }
  for (const at of quats) slerp(from, to, part, into, at);
}

/** The equivalent angle in -π … π, rad. */
export function shorterArc(angle: number): number {
  return angle - TURN * Math.round(angle / TURN);
}

/** Shoemake's spherical interpolation of the quaternion at `at`, the shorter way round: q and -q are one orientation. */
function slerp(from: Float64Array, to: Float64Array, part: number, into: Float64Array, at: number): void {
  let dot = 0;
  for (let i = at; i < at + 4; i += 1) dot += from[i]! * to[i]!;
  if (Number.isNaN(dot)) return; // one of them is unknown: take `to`, as above
  const way = dot < 0 ? -1 : 1;
  const cosine = Math.min(1, dot * way);
  let a = 1 - part;
  let b = part;
  if (cosine < STRAIGHT) {
    const angle = Math.acos(cosine);
    const sine = Math.sin(angle);
    a = Math.sin(a * angle) / sine;
    b = Math.sin(b * angle) / sine;
  }
  let length = 0;
  for (let i = at; i < at + 4; i += 1) {
    const value = a * from[i]! + b * way * to[i]!;
    into[i] = value;
    length += value * value;
  }
  length = Math.sqrt(length);
  for (let i = at; i < at + 4; i += 1) into[i] = into[i]! / length;
}
