import type { Extent } from '../../model/bounds.ts';
import { cornersOf } from '../../model/bounds.ts';
import type { PlacedBox } from '../../model/posed_body.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { fittingDistance, leastDistance, roomAt } from './framing.ts';
import { clamp } from './orbit.ts';

/** An upright cylinder around the whole body, in the world, metres. Turning about the vertical does not change it. */
export interface BodySpan {
  /** Its axis. */
  readonly x: number;
  readonly y: number;
  readonly radius: number;
  /** Its lower and upper end. */
  readonly low: number;
  readonly high: number;
}

/** The cylinder around these boxes; its axis is the middle of the floor area that they cover. Null for none, or if one of them
 *  has no finite position. */
export function spanOf(boxes: Iterable<PlacedBox>): BodySpan | null {
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  const points: number[] = [];
  for (const [{ matrixWorld }, box] of boxes) {
    cornersOf(box, matrixWorld.elements, 0, (x, y, z) => {
      points.push(x, y);
      min[0] = Math.min(min[0]!, x);
      min[1] = Math.min(min[1]!, y);
      min[2] = Math.min(min[2]!, z);
      max[0] = Math.max(max[0]!, x);
      max[1] = Math.max(max[1]!, y);
      max[2] = Math.max(max[2]!, z);
    });
  }
  const [x, y] = [(min[0]! + max[0]!) / 2, (min[1]! + max[1]!) / 2];
  let radius = 0;
  for (let i = 0; i < points.length; i += 2) {
    radius = Math.max(radius, Math.hypot(points[i]! - x, points[i + 1]! - y));
  }
  const span = { x, y, radius, low: min[2]!, high: max[2]! };
  return Object.values(span).every(Number.isFinite) ? span : null;
}

/** How far a body may rise above its place before the camera moves, as a fraction of the framed robot's radius. */
const LEASH = 0.3;
/** Between one leash and this many, the camera catches up; beyond that, the body is centred again. */
const CAUGHT_UP = 3;
/** Room kept above and below for the bobbing of a walk, as a fraction of the body's size, while the camera lags behind it over
 *  the floor. */
const SPARE = 0.03;
/** The most that the camera moves away for a growing body: a single wrong reading must not send it to the horizon. */
const MOST_GROWTH = 6;

/** The camera move that keeps the whole body in the picture. */
export interface Correction {
  /** The move of its target, world, metres. */
  readonly step: Vec3;
  /** The factor for its distance. */
  readonly growth: number;
}

/**
 * Keeps a moving body fully in the picture, with as little camera motion as possible. A body that stays in its framed place (a
 * walk, a squat) moves nothing. A body that leaves it (a flight, a jump, stairs) takes the camera along, which returns with the
 * body. A body that becomes too large for the picture (a car on its nose) is viewed from farther away, until it is framed again.
 * The height depends only on the current pose, so nothing drifts, swings or lags.
 */
export class WholeBody {
  #extent: Extent = { tall: 0.6, wide: 0.4, radius: 0.75 };
  /** The middle of the framed robot above the floor, metres. */
  #rest = 0.6;
  #growth = 1;

  /** The robot was framed with this extent, its middle at this height (metres). */
  frame(extent: Extent, height: number): void {
    this.#extent = extent;
    this.#rest = height;
    this.#growth = 1;
  }

  /** How much farther away the camera is than for the framed robot, as a factor. */
  get growth(): number {
    return this.#growth;
  }

  /** Forgets that the body was once larger. */
  shrink(): void {
    this.#growth = 1;
  }

  /** What a body at `span` needs in a picture of this aspect and height (CSS px) whose middle is at `middle` (world, metres). */
  correct(span: BodySpan, middle: Vec3, aspect: number, heightPx?: number): Correction {
    const half = (span.high - span.low) / 2;
    const fitting = fittingDistance(this.#extent, aspect, heightPx);
    const needed = leastDistance(half, span.radius, aspect) / fitting;
    const grown = Math.max(this.#growth, Math.min(needed, MOST_GROWTH));
    const growth = grown / this.#growth;
    this.#growth = grown;
    const { tall } = this.#extent;
    const stepping = Math.max(half, tall) + SPARE * (tall + span.radius);
    const over = roomAt(fitting * grown, { half: stepping, radius: span.radius }, aspect).radius;
    const { step, far } = towards(span, middle, over);
    const above = roomAt(fitting * grown, { half, radius: far + span.radius }, aspect).half;
    return { step: [...step, this.#height(span, above) - middle[2]], growth };
  }

  /** The height of the target, for a body in a picture that shows `room` above and below it. */
  #height({ low, high }: BodySpan, room: number): number {
    const { tall, radius } = this.#extent;
    const above = high - (this.#rest + tall);
    const below = low - (this.#rest - tall);
    const off = clamp(0, Math.min(above, below), Math.max(above, below));
    const air = room - tall;
    const leash = Math.max(0, Math.min(LEASH * radius, air));
    const least = above - air;
    const most = below + air;
    if (least > most) return (low + high) / 2;
    return this.#rest + clamp(followed(off, leash), least, most);
  }
}

/** How far the camera moves along with an offset `off`: not at all within the leash, and fully in the end. In between, the body
 *  is never off by more than the leash. */
function followed(off: number, leash: number): number {
  const far = Math.abs(off);
  if (far >= CAUGHT_UP * leash) return off;
  return Math.sign(off) * Math.max(0, far - leash) * (CAUGHT_UP / (CAUGHT_UP - 1));
}

/** The smallest step over the floor after which a body is within `room` of the middle, and the remaining distance of its axis
 *  from it.
 */
function towards(
  { x, y, radius }: BodySpan,
  middle: Vec3,
  room: number,
): { readonly step: readonly [x: number, y: number]; readonly far: number } {
  const [dx, dy] = [x - middle[0], y - middle[1]];
  const far = Math.hypot(dx, dy);
  const part = far === 0 ? 0 : clamp((far + radius - room) / far, 0, 1);
  return { step: [dx * part, dy * part], far: far * (1 - part) };
}
