import type { PosedBody } from '../../model/posed_body.ts';
import {
  addScaled,
  directionThrough,
  normalize,
  originOf,
  rejectFrom,
  rotateAbout,
  scale,
} from '../../model/vectors.ts';
import { coarseDisplay, displayOf, formatNumber } from '../../twin/format.ts';
import { limitMargin } from '../../twin/limits.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { type BalancePaints, drawRod, faint, fillRing, type Spot } from './balance_shapes.ts';
import { limbAcross } from './deviations.ts';
import { type SignLabel, type SignPicture, tonePaint } from './sign.ts';
import type { Facets, Paint } from './strokes.ts';

/** Sizes in radii of the robot. */
const RADIUS = 0.2;
const BAND = 0.035;
const NEEDLE = 0.006;
const STOP = 0.007;

/** A joint whose limits are drawn. */
export interface ShownJoint {
  readonly joint: string;
  /** Distance to the nearer limit, rad or m; negative beyond it. */
  readonly left: number;
  readonly slides: boolean;
}

/** A joint whose limits are drawn, with the remaining range in words. */
export interface DrawnJoint {
  readonly shown: ShownJoint;
  readonly label: SignLabel;
}

interface JointPaints {
  /** The full range between the limits. */
  readonly way: Paint;
  /** The range left to the nearer limit. */
  readonly left: Paint;
  /** The joint's position. */
  readonly now: Paint;
}

/** Draws the range of joints between their limits. Skips joints that the model lacks or that have no limits. */
export function drawJointLimits(
  facets: Facets,
  picture: SignPicture,
  names: readonly string[],
  { mass }: Pick<BalancePaints, 'mass'>,
): DrawnJoint[] {
  const { body, reach, frame } = picture;
  const paints = { way: faint(mass, 0.22), left: tonePaint(picture, 'accent'), now: mass };
  return names.flatMap((name) => {
    const drawn = drawJoint(facets, body, name, reach, paints);
    if (drawn === null) return [];
    const { at, ...shown } = drawn;
    const display = displayOf(shown.slides ? 'm' : 'rad', frame.settings.angle);
    const text = `${formatNumber(shown.left, coarseDisplay(display)).trim()} ${display.unit}`;
    const level = shown.left < 0 ? 'caution' : 'ok';
    const label: SignLabel = {
      ...{ key: `left-${name}`, text, level, at, middle: at, lines: [[at, at]] },
      explain: ['balance.room'],
    };
    return [{ shown, label }];
  });
}

/** Draws a joint's range between its limits, its position, and the range left to the nearer limit. Null for a joint that the
 *  model lacks or that has no limits. */
function drawJoint(
  facets: Facets,
  body: PosedBody,
  name: string,
  reach: number,
  paints: JointPaints,
): (ShownJoint & { readonly at: Vec3 }) | null {
  const joint = body.joint(name);
  const worldFromLink = joint === undefined ? undefined : body.linkMatrix(joint.link)?.elements;
  const limits = body.manifest.joints.find((one) => one.name === name)?.limits ?? null;
  const value = body.jointValue(name);
  if (joint === undefined || worldFromLink === undefined || limits === null || value === null) return null;
  const margin = limitMargin(value, limits);
  if (margin === null) return null;
  const { lower, upper } = limits;
  const { left, nearer } = margin;
  /** From the joint's position to the nearer limit. */
  const way = nearer === 'lower' ? -left : left;
  const at = originOf(worldFromLink);
  const axis = directionThrough(worldFromLink, joint.axis);
  const spot = joint.slides
    ? drawSlide(facets, at, axis, value, lower, upper, way, reach, paints)
    : drawTurn(
        facets,
        body,
        joint.link,
        worldFromLink,
        { at, axis },
        value,
        lower,
        upper,
        way,
        reach,
        paints,
      );
  return { joint: name, left, slides: joint.slides, at: spot };
}

function drawTurn(
  facets: Facets,
  body: PosedBody,
  link: string,
  worldFromLink: ArrayLike<number>,
  { at, axis }: Omit<Spot, 'ahead'>,
  value: number,
  lower: number,
  upper: number,
  way: number,
  reach: number,
  paints: JointPaints,
): Vec3 {
  const limb = limbAcross(axis, body.linkBox(link), worldFromLink);
  const [inner, outer] = [(RADIUS - BAND) * reach, RADIUS * reach];
  const turned = (by: number): Spot => ({ at, axis, ahead: rotateAbout(axis, by, limb) });
  const on = (by: number, radius: number) => addScaled(at, turned(by).ahead, radius);
  const sweep = Math.min(upper - lower, 2 * Math.PI);
  fillRingBothSides(facets, turned(lower - value), inner, outer, paints.way, sweep);
  fillRingBothSides(facets, turned(0), inner, outer, paints.left, clamp(way, 2 * Math.PI));
  for (const limit of [lower, upper]) {
    const by = limit - value;
    drawRod(facets, on(by, inner * 0.94), on(by, outer * 1.06), STOP * reach, faint(paints.left, 0.9));
  }
  drawRod(facets, at, on(0, outer * 1.08), NEEDLE * reach, paints.now);
  return on(clamp(way, 2 * Math.PI) / 2, outer);
}

/** Draws a rail along which the joint slides. */
function drawSlide(
  facets: Facets,
  at: Vec3,
  axis: Vec3,
  value: number,
  lower: number,
  upper: number,
  way: number,
  reach: number,
  { way: whole, left, now }: JointPaints,
): Vec3 {
  const to = (limit: number) => addScaled(at, axis, limit - value);
  drawRod(facets, to(lower), to(upper), NEEDLE * reach, whole);
  drawRod(facets, at, addScaled(at, axis, way), NEEDLE * reach * 1.5, left);
  const across = normalize(rejectFrom(Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], axis));
  for (const [spot, size, paint] of [
    [to(lower), BAND, left],
    [to(upper), BAND, left],
    [at, 2 * BAND, now],
  ] as const) {
    const half = (size / 2) * reach;
    drawRod(facets, addScaled(spot, across, -half), addScaled(spot, across, half), STOP * reach, paint);
  }
  return addScaled(at, axis, way / 2);
}

/** Fills the area between two radii, visible from both sides. */
function fillRingBothSides(
  facets: Facets,
  { at, axis, ahead }: Spot,
  inner: number,
  outer: number,
  paint: Paint,
  sweep: number,
): void {
  fillRing(facets, { at, axis, ahead }, inner, outer, paint, sweep);
  fillRing(facets, { at, axis: scale(axis, -1), ahead }, inner, outer, paint, -sweep);
}

function clamp(value: number, most: number): number {
  return Math.min(most, Math.max(-most, value));
}
