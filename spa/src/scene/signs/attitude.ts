import type { Schema } from '@posecast/wire';
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
import { type AngleUnit, displayOf, formatNumber } from '../../twin/format.ts';
import {
  invertQuat,
  rotateVector,
  multiplyQuats as turned,
  type Vec3,
  withoutHeading,
} from '../../twin/rotation.ts';
import { type Imu, ImuTable, leanOf } from '../../twin/sensors/imus.ts';
import { type Sign, type SignFrame, type SignPicture, tonePaint } from './sign.ts';
import type { Paint } from './strokes.ts';

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

export interface ShownAttitude {
  /** Height of the reference plane, m; null while no sensor tells what is level. */
  readonly planeZ: number | null;
  /** Roll and pitch by the body's IMU, rad; null without a reading. */
  readonly roll: number | null;
  readonly pitch: number | null;
  /** Sites of the other IMUs that are drawn. */
  readonly feet: readonly string[];
}

/** The horizontal and the robot's lean: a plane at the lowest foot, the plumb line, the body's own up axis. */
export class Attitude implements Sign {
  static readonly key = 'level';
  static readonly menu = {
    name: { en: 'Level and gravity', ko: '수평과 중력' },
    explain: 'signs.plumb',
    setting: 'level',
  } as const;
  drawn: ShownAttitude = { planeZ: null, roll: null, pitch: null, feet: [] };
  readonly #imus: ImuTable;
  /** Whether the robot reports its orientation by odometry. */
  readonly #based: boolean;

  constructor(schema: Schema) {
    this.#imus = new ImuTable(schema);
    this.#based = schema.field('baseq') !== null;
  }

  static can(schema: Schema): boolean {
    return new ImuTable(schema).imus.length > 0 || schema.field('baseq') !== null;
  }

  /** Roll and pitch of the body, rad; null without a reading. Null for a robot without a sensor for it. */
  get lean(): Pick<ShownAttitude, 'roll' | 'pitch'> | null {
    const { body } = this.#imus;
    return body === null ? null : (leanOf(body) ?? { roll: null, pitch: null });
  }

  read({ codes }: SignFrame): void {
    this.#imus.read(codes);
  }

  draw(picture: SignPicture): void {
    const { body: imu, imus } = this.#imus;
    const { body, supportM } = picture;
    const lean = imu === null ? null : leanOf(imu);
    const planeZ = this.#based || lean !== null ? lowest(body) : null;
    if (planeZ !== null && supportM === null) drawPlane(picture, planeZ);
    if (imu !== null && lean !== null) drawPlumb(picture, imu, planeZ ?? 0);
    const feet = imus.filter((one) => one !== imu && drawFoot(picture, one)).map(({ site }) => site);
    this.drawn = { planeZ, roll: lean?.roll ?? null, pitch: lean?.pitch ?? null, feet };
  }
}

/** The paint of thin lines that close a shape; fainter beside the signs of balance. */
function rimOf(picture: SignPicture): Paint {
  return tonePaint(picture, 'level', picture.supportM === null ? 0.8 : 0.25, false);
}

/** Not beside the signs of balance: the plane would look like the support. */
function drawPlane(picture: SignPicture, z: number): void {
  const { strokes, body, reach } = picture;
  const rim = rimOf(picture);
  const [x, y] = originOf(body.root.matrixWorld.elements);
  const at: Vec3 = [x, y, z + LIFT * reach];
  strokes.fan(at, WORLD_UP, WORLD_X, 2 * Math.PI, 0, PLANE * reach, tonePaint(picture, 'level', 0.07, false));
  strokes.arc(at, WORLD_UP, WORLD_X, 2 * Math.PI, PLANE * reach, 0.003 * reach, rim);
  for (let quarter = 0; quarter < 4; quarter += 1) {
    const along = rotateAbout(WORLD_UP, (quarter * Math.PI) / 2, WORLD_X);
    const from = addScaled(at, along, PLANE * reach * 0.93);
    strokes.shaft(from, along, PLANE * reach * 0.14, 0.003 * reach, 0.003 * reach, rim);
  }
}

/** Draws a line from the body's IMU straight down to the plane, and the body's up axis beside the world's. The signs of balance
 *  have their own plumb line. */
function drawPlumb(picture: SignPicture, imu: Imu, planeZ: number): void {
  const { strokes, body, reach, supportM } = picture;
  const [gravity, faint] = [tonePaint(picture, 'level'), tonePaint(picture, 'level', 0.55)];
  const worldFromLink = linkOf(body, imu);
  if (worldFromLink === undefined) return;
  const at = pointThrough(worldFromLink, imu.xyz);
  const thin = 0.005 * reach;
  if (supportM === null) {
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
  strokes.fan(
    at,
    normalize(cross(WORLD_UP, own)),
    WORLD_UP,
    angle,
    0,
    UP * reach,
    tonePaint(picture, 'level', 0.3),
  );
}

/** Draws a ring tilted by the orientation that the foot's own IMU reports; if the reading is right, it is parallel to the
 *  sole. */
function drawFoot(picture: SignPicture, imu: Imu): boolean {
  const { strokes, body, reach } = picture;
  const rim = rimOf(picture);
  const worldFromLink = linkOf(body, imu);
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

function linkOf(body: PosedBody, { link }: Imu): Transform | undefined {
  return (link === null ? body.root.matrixWorld : body.linkMatrix(link))?.elements;
}

/** The lowest z of the robot's boxes, m; of its link origins if it has no boxes. */
function lowest(body: PosedBody): number {
  let low = Number.POSITIVE_INFINITY;
  for (const [link, box] of body.boxes) low = Math.min(low, lowestZ(box, link.matrixWorld.elements));
  if (Number.isFinite(low)) return low;
  for (const name of body.linkNames) low = Math.min(low, body.linkMatrix(name)!.elements[14]!);
  return Number.isFinite(low) ? low : 0;
}

const SVG = 'http://www.w3.org/2000/svg';
/** The lean (rad) at which the bubble of the spirit level reaches the rim. */
const FULL_RAD = 0.35;
const RIM = 11;

/** Shows roll and pitch as numbers and as the bubble of a spirit level, in the host's element for them. */
export class AttitudeReadout {
  /** The element in the host; hidden without a reading. */
  readonly root = document.createElement('div');
  readonly #bubble = document.createElementNS(SVG, 'circle');
  readonly #roll = document.createTextNode('');
  readonly #pitch = document.createTextNode('');

  constructor(host: HTMLElement) {
    this.root.className = 'stage-level';
    this.root.dataset.testid = 'level';
    this.root.dataset.explains = 'signs.plumb signs.disc';
    this.root.hidden = true;
    const glass = document.createElementNS(SVG, 'svg');
    glass.setAttribute('viewBox', '-17 -17 34 34');
    glass.setAttribute('aria-hidden', 'true');
    for (const r of [16, 5]) {
      const ring = document.createElementNS(SVG, 'circle');
      ring.setAttribute('r', String(r));
      ring.setAttribute('class', 'glass');
      glass.append(ring);
    }
    this.#bubble.setAttribute('r', '4.5');
    this.#bubble.setAttribute('class', 'bubble');
    glass.append(this.#bubble);
    const list = document.createElement('dl');
    for (const [name, text] of [
      ['roll', this.#roll],
      ['pitch', this.#pitch],
    ] as const) {
      const term = document.createElement('dt');
      term.textContent = name;
      const value = document.createElement('dd');
      value.append(text);
      list.append(term, value);
    }
    this.root.append(glass, list);
    host.append(this.root);
  }

  /** Shows a lean, or that there is no reading now; null hides the readout (the robot has no such sensor). */
  show(lean: Attitude['lean'], angle: AngleUnit, live: boolean): void {
    this.root.hidden = lean === null;
    if (lean === null) return;
    const { roll, pitch } = lean;
    this.root.dataset.old = String(!live);
    const display = displayOf('rad', angle);
    const unit = angle === 'deg' ? '°' : ' rad';
    const said = (value: number | null) => formatNumber(value, display) + (value === null ? '' : unit);
    for (const [text, value] of [
      [this.#roll, roll],
      [this.#pitch, pitch],
    ] as const) {
      const words = said(value);
      if (text.data !== words) text.data = words;
    }
    // A bubble moves to the high side: to the left if the robot leans right, back if it leans forward.
    const way = Math.hypot(roll ?? 0, pitch ?? 0);
    const part = way === 0 ? 0 : (Math.min(1, way / FULL_RAD) * RIM) / way;
    this.#bubble.setAttribute(
      'transform',
      `translate(${(-(roll ?? 0) * part).toFixed(1)} ${((pitch ?? 0) * part).toFixed(1)})`,
    );
    this.#bubble.setAttribute('visibility', roll === null ? 'hidden' : 'visible');
  }

  dispose(): void {
    this.root.remove();
  }
}
