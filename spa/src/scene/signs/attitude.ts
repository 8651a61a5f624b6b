import { lowestZ } from '../../model/bounds.ts';
import type { PosedBody } from '../../model/posed_body.ts';
import {
  addScaled,
  cross,
  directionThrough,
  dot,
  normalize,
  originOf,
  pointThrough,
  quatOfTransform,
  rotateAbout,
  type Transform,
} from '../../model/vectors.ts';
import {
  invertQuat,
  rotateVector,
  multiplyQuats as turned,
  type Vec3,
  withoutHeading,
} from '../../twin/rotation.ts';
import { type Imu, leanOf } from '../../twin/sensors/imus.ts';
import type { Paint } from './picture_numbers.ts';
import type { Strokes } from './strokes.ts';

/** Sizes in radii of the robot. */
const PLANE = 0.62;
const LIFT = 0.004;
const GRAVITY = 0.3;
const UP = 0.34;
const FOOT = 0.13;
/** A smaller lean looks upright, rad. */
const LEAST_LEAN = 0.02;

const WORLD_UP: Vec3 = [0, 0, 1];
const WORLD_X: Vec3 = [1, 0, 0];
const DOWN: Vec3 = [0, 0, -1];

export interface AttitudePaints {
  readonly plane: Paint;
  readonly rim: Paint;
  readonly gravity: Paint;
  /** Thin lines that extend others. */
  readonly faint: Paint;
  readonly lean: Paint;
  /** False: without plane and plumb line. The balance signs have their own plumb line, and the plane would look like the
   *  support. */
  readonly ground: boolean;
}

export interface ShownAttitude {
  /** Height of the reference plane, m; null while no sensor tells what is level. */
  readonly planeZ: number | null;
  /** Roll and pitch by the body's IMU, rad; null without a reading. */
  readonly roll: number | null;
  readonly pitch: number | null;
  /** Sites of the other IMUs that are drawn. */
  readonly feet: readonly string[];
}

/** Draws the horizontal and the robot's lean: a plane at the lowest foot, the plumb line, the body's own up axis. */
export class AttitudeOverlay {
  shown: ShownAttitude = { planeZ: null, roll: null, pitch: null, feet: [] };

  /** Adds its strokes. `based`: the robot reports its orientation by odometry; `reach`: its radius, m. */
  draw(
    strokes: Strokes,
    figure: PosedBody | null,
    imus: readonly Imu[],
    body: Imu | null,
    based: boolean,
    reach: number,
    paints: AttitudePaints,
  ): void {
    const lean = body === null ? null : leanOf(body);
    const planeZ = figure !== null && (based || lean !== null) ? lowest(figure) : null;
    const feet: string[] = [];
    if (figure !== null) {
      if (planeZ !== null && paints.ground) drawPlane(strokes, figure, planeZ, reach, paints);
      if (body !== null && lean !== null) drawPlumb(strokes, figure, body, planeZ ?? 0, reach, paints);
      for (const imu of imus) {
        if (imu !== body && drawFoot(strokes, figure, imu, reach, paints)) feet.push(imu.site);
      }
    }
    this.shown = { planeZ, roll: lean?.roll ?? null, pitch: lean?.pitch ?? null, feet };
  }
}

function drawPlane(
  strokes: Strokes,
  figure: PosedBody,
  z: number,
  reach: number,
  { plane, rim }: AttitudePaints,
): void {
  const [x, y] = originOf(figure.root.matrixWorld.elements);
  const at: Vec3 = [x, y, z + LIFT * reach];
  strokes.fan(at, WORLD_UP, WORLD_X, 2 * Math.PI, 0, PLANE * reach, plane);
  strokes.arc(at, WORLD_UP, WORLD_X, 2 * Math.PI, PLANE * reach, 0.003 * reach, rim);
  for (let quarter = 0; quarter < 4; quarter += 1) {
    const along = rotateAbout(WORLD_UP, (quarter * Math.PI) / 2, WORLD_X);
    const from = addScaled(at, along, PLANE * reach * 0.93);
    strokes.shaft(from, along, PLANE * reach * 0.14, 0.003 * reach, 0.003 * reach, rim);
  }
}

/** Draws a line from the body's IMU straight down to the plane, and the body's up axis beside the world's. */
function drawPlumb(
  strokes: Strokes,
  figure: PosedBody,
  imu: Imu,
  planeZ: number,
  reach: number,
  { gravity, faint, lean, ground }: AttitudePaints,
): void {
  const worldFromLink = linkOf(figure, imu);
  if (worldFromLink === undefined) return;
  const at = pointThrough(worldFromLink, imu.xyz);
  const thin = 0.005 * reach;
  if (ground) {
    const down = at[2] - planeZ;
    const arrow = Math.min(GRAVITY * reach, Math.max(0, down));
    const head = Math.min(arrow, 0.06 * reach);
    strokes.shaft(at, DOWN, arrow - head * 0.9, thin, thin, gravity);
    strokes.shaft(addScaled(at, DOWN, arrow - head), DOWN, head, 0.022 * reach, 0, gravity);
    const left = Math.max(0, down - arrow);
    strokes.shaft(addScaled(at, DOWN, arrow), DOWN, left, thin * 0.4, thin * 0.4, faint);
    const foot: Vec3 = [at[0], at[1], planeZ + LIFT * reach * 2];
    strokes.arc(foot, WORLD_UP, WORLD_X, 2 * Math.PI, 0.03 * reach, thin * 0.8, gravity);
  }

  const own = directionThrough(worldFromLink, WORLD_UP);
  const angle = Math.acos(Math.min(1, Math.max(-1, dot(own, WORLD_UP))));
  if (angle < LEAST_LEAN) return;
  strokes.shaft(at, own, UP * reach, thin, thin * 0.6, gravity);
  strokes.shaft(at, WORLD_UP, UP * reach, thin * 0.5, thin * 0.5, faint);
  strokes.fan(at, normalize(cross(WORLD_UP, own)), WORLD_UP, angle, 0, UP * reach, lean);
}

/** Draws a ring tilted by the orientation that the foot's own IMU reports; if the reading is right, it is parallel to the
 *  sole. */
function drawFoot(
  strokes: Strokes,
  figure: PosedBody,
  imu: Imu,
  reach: number,
  { rim }: AttitudePaints,
): boolean {
  const worldFromLink = linkOf(figure, imu);
  if (worldFromLink === undefined || imu.worldFromSensor === null || imu.link === null) return false;
  const at = pointThrough(worldFromLink, imu.xyz);
  const [w, , , z] = quatOfTransform(worldFromLink);
  const heading = 2 * Math.atan2(z, w);
  const measured = withoutHeading(turned(imu.worldFromSensor, invertQuat(imu.linkFromSensor)));
  const up = rotateAbout(WORLD_UP, heading, rotateVector(measured, WORLD_UP));
  const ahead = rotateAbout(WORLD_UP, heading, rotateVector(measured, WORLD_X));
  strokes.arc(at, up, ahead, 2 * Math.PI, FOOT * reach, 0.0035 * reach, rim);
  strokes.shaft(at, ahead, FOOT * reach, 0.003 * reach, 0.003 * reach, rim);
  return true;
}

function linkOf(figure: PosedBody, { link }: Imu): Transform | undefined {
  return (link === null ? figure.root.matrixWorld : figure.linkMatrix(link))?.elements;
}

/** The lowest z of the robot's boxes, m; of its link origins if it has no boxes. */
function lowest(figure: PosedBody): number {
  let low = Number.POSITIVE_INFINITY;
  for (const [link, box] of figure.boxes) low = Math.min(low, lowestZ(box, link.matrixWorld.elements));
  if (Number.isFinite(low)) return low;
  for (const name of figure.linkNames) low = Math.min(low, figure.linkMatrix(name)!.elements[14]!);
  return Number.isFinite(low) ? low : 0;
}
