import type { Level } from '@posecast/wire';
import { addScaled, cross, dot, normalize, rejectFrom, rotateAbout, scale } from '../../model/vectors.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { levelPaint, type SignPicture } from './sign.ts';
import type { Facets, Paint } from './strokes.ts';

/** The colours of the ball's quarters, in both themes: those of a crash-test dummy's markers. */
const WHITE = 0xf7f8fa;
const BLACK = 0x14181f;
/** The colours of an out-of-date ball; the stale tone of both themes contrasts with them. */
const OLD_BLACK = 0x545d6b;

/** The paints of the balance signs. All of them show through the robot. */
export interface BalancePaints {
  readonly white: Paint;
  readonly black: Paint;
  /** The signs of the mass: plumb line, capture point, trace. */
  readonly mass: Paint;
  /** The support polygon. */
  readonly support: Paint;
  /** The centres of pressure. */
  readonly pressure: Paint;
  /** A foot that begins to tip. */
  readonly tipping: Paint;
  /** The margin by level; `ok` is drawn like the support. */
  readonly margin: Paint;
}

export function paintsOf(picture: SignPicture, level: Level): BalancePaints {
  const { colors } = picture;
  const { live } = picture.frame;
  const solid = (color: number): Paint => ({ color, through: true });
  const tone = (color: number): Paint => solid(live ? color : colors.stale);
  const of = (at: Level) => levelPaint(picture, at);
  const support = tone(colors.level);
  return {
    white: tone(WHITE),
    black: solid(live ? BLACK : OLD_BLACK),
    mass: tone(colors.ink),
    support,
    pressure: of('ok'),
    tipping: of('caution'),
    margin: level === 'ok' ? support : of(level),
  };
}

/** A paint at a fraction of its opacity. */
export function faint(paint: Paint, opacity: number): Paint {
  return { ...paint, opacity: (paint.opacity ?? 1) * opacity };
}

/** Segments of a full turn. */
const STEPS = 32;
/** Triangles along an edge of each octant of the ball. */
const FINE = 7;
/** At a sharp corner, a line is at most this much wider than elsewhere. */
const MITRE = 2;

export const UP: Vec3 = [0, 0, 1];

/** A position with a forward direction, in which shapes are drawn. `axis` and `ahead` are perpendicular unit vectors. */
export interface Spot {
  readonly at: Vec3;
  readonly axis: Vec3;
  readonly ahead: Vec3;
}

/** A position on the floor. */
export function floorSpot(at: Vec3, ahead: Vec3 = [1, 0, 0]): Spot {
  return { at, axis: UP, ahead };
}

/** Fills a convex polygon, its corners counter-clockwise as seen by the viewer. */
export function fillPolygon(facets: Facets, corners: readonly Vec3[], paint: Paint): void {
  for (let i = 2; i < corners.length; i += 1) facets.add(corners[0]!, corners[i - 1]!, corners[i]!, paint);
}

/** Fills a regular polygon: a disc, or with few `corners` a triangle, a square, an octagon; the first corner points ahead. */
export function fillRound(facets: Facets, spot: Spot, radius: number, paint: Paint, corners = STEPS): void {
  fillPolygon(facets, onCircle(spot, radius, 2 * Math.PI, corners).slice(0, corners), paint);
}

/** Fills the area between two radii, over a sweep (rad) from ahead; by default a full turn. */
export function fillRing(
  facets: Facets,
  spot: Spot,
  inner: number,
  outer: number,
  paint: Paint,
  sweep = 2 * Math.PI,
  corners = STEPS,
): void {
  const steps = Math.max(1, Math.ceil((Math.abs(sweep) / (2 * Math.PI)) * corners));
  const [near, far] = [onCircle(spot, inner, sweep, steps), onCircle(spot, outer, sweep, steps)];
  for (let i = 0; i < steps; i += 1) {
    const [a, b, c, d] = [near[i]!, far[i]!, far[i + 1]!, near[i + 1]!];
    if (sweep < 0) quad(facets, d, c, b, a, paint);
    else quad(facets, a, b, c, d, paint);
  }
}

/** Fills a disc in four quarters of two colours, like the markers on crash-test dummies. */
export function fillQuarters(facets: Facets, spot: Spot, radius: number, one: Paint, other: Paint): void {
  for (let quarter = 0; quarter < 4; quarter += 1) {
    const ahead = rotateAbout(spot.axis, (quarter * Math.PI) / 2, spot.ahead);
    const corners = [spot.at, ...onCircle({ ...spot, ahead }, radius, Math.PI / 2, STEPS / 4)];
    fillPolygon(facets, corners, quarter % 2 === 0 ? one : other);
  }
}

/** Draws a line on a surface with this normal: through points, with mitred corners. */
export function drawLine(
  facets: Facets,
  points: readonly Vec3[],
  width: number,
  paint: Paint | ((from: number) => Paint),
  { closed = false, normal = UP }: { closed?: boolean; normal?: Vec3 } = {},
): void {
  const last = points.length - 1;
  if (last < 1) return;
  const sides = points.map((point, i) => {
    const before = closed || i > 0 ? points.at(i - 1)! : point;
    const after = closed || i < last ? points[(i + 1) % points.length]! : point;
    return sideways(before, point, after, normal, width / 2);
  });
  const count = closed ? points.length : last;
  for (let i = 0; i < count; i += 1) {
    const next = (i + 1) % points.length;
    const [a, b, side, nextSide] = [points[i]!, points[next]!, sides[i]!, sides[next]!];
    quad(
      facets,
      addScaled(a, side, -1),
      addScaled(b, nextSide, -1),
      addScaled(b, nextSide),
      addScaled(a, side),
      typeof paint === 'function' ? paint(i) : paint,
    );
  }
}

/** Draws a closed dashed line on the floor. */
export function drawDashes(
  facets: Facets,
  corners: readonly Vec3[],
  width: number,
  dash: number,
  paint: Paint,
): void {
  corners.forEach((from, i) => {
    const to = corners[(i + 1) % corners.length]!;
    const way = addScaled(to, from, -1);
    const length = Math.hypot(...way);
    const pieces = Math.max(1, Math.round(length / dash / 2));
    for (let piece = 0; piece < pieces; piece += 1) {
      const [begin, end] = [(piece + 0.25) / pieces, (piece + 0.75) / pieces];
      drawLine(facets, [addScaled(from, way, begin), addScaled(from, way, end)], width, paint);
    }
  });
}

/** Draws a thin upright or leaning rod of three sides between two points. */
export function drawRod(facets: Facets, from: Vec3, to: Vec3, radius: number, paint: Paint): void {
  const axis = normalize(addScaled(to, from, -1));
  const ahead = normalize(rejectFrom(Math.abs(axis[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], axis));
  const low = onCircle({ at: from, axis, ahead }, radius, 2 * Math.PI, 4);
  const high = onCircle({ at: to, axis, ahead }, radius, 2 * Math.PI, 4);
  for (let i = 0; i < 4; i += 1) quad(facets, low[i]!, low[i + 1]!, high[i + 1]!, high[i]!, paint);
}

/** Draws a ball in octants of two alternating colours, with a rim of a third. `heading`: rad from the world's x axis. */
export function drawBall(
  facets: Facets,
  at: Vec3,
  radius: number,
  heading: number,
  one: Paint,
  other: Paint,
  rim: Paint,
): void {
  facets.addShape(RIM, at, radius * 1.12, heading, rim); // inside out: only the part beside the ball is visible
  facets.addShape(ONE, at, radius, heading, one);
  facets.addShape(OTHER, at, radius, heading, other);
}

/** The unit ball's triangles: the even and the odd octants, and both inside out. */
const EIGHTHS = ballTriangles();
const [ONE, OTHER] = [numbersOf(EIGHTHS[0]), numbersOf(EIGHTHS[1])];
const RIM = numbersOf(EIGHTHS.flat().reverse());

function numbersOf(corners: readonly Vec3[]): Float64Array {
  return Float64Array.from(corners.flat());
}

/** Three corners per triangle. */
function ballTriangles(): readonly [Vec3[], Vec3[]] {
  const ball: [Vec3[], Vec3[]] = [[], []];
  for (let eighth = 0; eighth < 8; eighth += 1) {
    const sign: Vec3 = [eighth & 1 ? -1 : 1, eighth & 2 ? -1 : 1, eighth & 4 ? -1 : 1];
    const mirrored = sign[0] * sign[1] * sign[2] < 0;
    const on = (i: number, j: number): Vec3 =>
      normalize([sign[0] * i, sign[1] * j, sign[2] * (FINE - i - j)]);
    const add = (...corners: Vec3[]) => {
      ball[mirrored ? 1 : 0].push(...(mirrored ? corners.reverse() : corners));
    };
    for (let i = 0; i < FINE; i += 1) {
      for (let j = 0; j < FINE - i; j += 1) {
        add(on(i, j), on(i + 1, j), on(i, j + 1));
        if (i + j < FINE - 1) add(on(i + 1, j), on(i + 1, j + 1), on(i, j + 1));
      }
    }
  }
  return ball;
}

/** Points along a circle, starting ahead. */
function onCircle({ at, axis, ahead }: Spot, radius: number, sweep: number, steps: number): Vec3[] {
  const side = cross(axis, ahead);
  return Array.from({ length: steps + 1 }, (_, i) => {
    const angle = (sweep * i) / steps;
    return addScaled(addScaled(at, ahead, radius * Math.cos(angle)), side, radius * Math.sin(angle));
  });
}

/** From a point of a line to its left border: perpendicular to the mean of both directions, and longer the more these differ. */
function sideways(before: Vec3, at: Vec3, after: Vec3, normal: Vec3, half: number): Vec3 {
  const [one, other] = [normalize(addScaled(at, before, -1)), normalize(addScaled(after, at, -1))];
  const both = addScaled(one, other);
  const mitre = Math.max(1 + dot(one, other), Math.hypot(...both) / MITRE, 1e-6);
  return scale(cross(normal, both), half / mitre);
}

function quad(facets: Facets, a: Vec3, b: Vec3, c: Vec3, d: Vec3, paint: Paint): void {
  facets.add(a, b, c, paint);
  facets.add(a, c, d, paint);
}
