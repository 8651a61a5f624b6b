import { JOINT, JointMapping, type Schema } from '@posecast/wire';
import {
  addScaled,
  directionThrough,
  dot,
  normalize,
  originOf,
  rejectFrom,
  rotateAbout,
  scale,
  type Transform,
} from '../../model/vectors.ts';
import { coarseDisplay, displayOf, formatNumber } from '../../twin/format.ts';
import { CLOSE_AGAIN } from '../../twin/joints.ts';
import { JointChannels } from '../../twin/kinematic_tree.ts';
import { placeOf } from '../../twin/names.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { valueAt } from '../../twin/values.ts';
import {
  levelPaint,
  type Sign,
  type SignFrame,
  type SignGhost,
  type SignLabel,
  type SignPicture,
  type SignSettings,
} from './sign.ts';
import type { Paint } from './strokes.ts';

/** The bit of `flags` for a joint that is compliant on purpose. */
const COMPLIANT_BIT = 'comply';

/** A channel whose position deviates from its command. */
export interface Deviation {
  readonly channel: string;
  /** ref − pos, in the channel's unit (rad, or m for a prismatic joint). */
  error: number;
  readonly unit: string;
  /** The joint is compliant on purpose: the deviation is shown, but is no fault. */
  compliant: boolean;
  /** The URDF joints it moves, with the actual and commanded position of each (rad or m, couplings applied). */
  readonly joints: readonly { readonly joint: string; pos: number; ref: number }[];
}

interface Watched {
  readonly index: number;
  readonly tolerance: number;
  readonly deviation: Deviation;
  /** Indices of its joints in both mappings. */
  readonly at: readonly { pos: number; ref: number }[];
  apart: boolean;
}

/** Finds channels that deviate from their command by more than their tolerance. `read` reuses the same objects. */
export class DeviationTable {
  readonly #schema: Schema;
  readonly #pos: JointMapping;
  readonly #ref: JointMapping;
  readonly #watched: readonly Watched[];
  readonly #complianceMask: number;
  readonly #ghost: Float64Array;
  #limbs: readonly string[] = [];

  constructor(schema: Schema) {
    this.#schema = schema;
    this.#pos = new JointMapping(schema, 'pos');
    this.#ref = new JointMapping(schema, 'ref');
    this.#ghost = new Float64Array(this.#pos.joints.length);
    const bit = schema.field('flags')?.bits.indexOf(COMPLIANT_BIT) ?? -1;
    this.#complianceMask = bit < 0 ? 0 : 1 << bit;
    const [pos, ref] = [schema.field('pos'), schema.field('ref')];
    const both = pos !== null && ref !== null && pos.labelSet === ref.labelSet;
    const channels = new JointChannels(schema);
    this.#watched = (both ? pos.labels : []).flatMap((channel, index) => {
      const tolerance = schema.mapping.tolerance(channel);
      if (tolerance === null) return [];
      const joints = channels.jointsOf(channel);
      return [
        {
          index,
          tolerance,
          apart: false,
          deviation: {
            channel,
            error: 0,
            unit: schema.mapping.unit('pos', channel) ?? pos!.unit,
            compliant: false,
            joints: joints.map((joint) => ({ joint, pos: 0, ref: 0 })),
          },
          at: joints.map((joint) => ({
            pos: placeOf(this.#pos.joints, joint),
            ref: placeOf(this.#ref.joints, joint),
          })),
        },
      ];
    });
  }

  /** The channels that deviate by more than their tolerance (with hysteresis). Channels without a reading are left out.
   */
  read(codes: Int32Array): Deviation[] {
    const schema = this.#schema;
    const [pos, ref, flags] = [schema.field('pos'), schema.field('ref'), schema.field('flags')];
    let jointsRead = false;
    const apart: Deviation[] = [];
    for (const watched of this.#watched) {
      const { index, tolerance, deviation, at } = watched;
      const is = valueAt(codes, pos, index);
      const commanded = valueAt(codes, ref, index);
      if (is === null || commanded === null) {
        watched.apart = false;
        continue;
      }
      deviation.error = commanded - is;
      const off = Math.abs(deviation.error);
      watched.apart = off > tolerance || (watched.apart && off > tolerance * CLOSE_AGAIN);
      if (!watched.apart) continue;
      const mask = flags?.labelSet === JOINT ? valueAt(codes, flags, index) : null;
      deviation.compliant = ((mask ?? 0) & this.#complianceMask) !== 0;
      if (!jointsRead) {
        this.#pos.evaluate(codes);
        this.#ref.evaluate(codes);
        jointsRead = true;
      }
      deviation.joints.forEach((joint, i) => {
        joint.pos = this.#pos.values[at[i]!.pos] ?? Number.NaN;
        joint.ref = this.#ref.values[at[i]!.ref] ?? Number.NaN;
      });
      apart.push(deviation);
    }
    return apart;
  }

  /** These deviations as a ghost: at the command, or at the actual position if the body shows the command. Joints that are compliant
   *  on purpose are left out; null if that leaves none. */
  ghost(apart: readonly Deviation[], shown: SignSettings['shown']): SignGhost | null {
    const joints = apart.filter(({ compliant }) => !compliant).flatMap((deviation) => deviation.joints);
    if (joints.length === 0) return null;
    const names = this.#pos.joints;
    this.#ghost.fill(Number.NaN);
    for (const { joint, pos, ref } of joints)
      this.#ghost[placeOf(names, joint)] = shown === 'ref' ? pos : ref;
    const same =
      this.#limbs.length === joints.length && joints.every(({ joint }, i) => joint === this.#limbs[i]);
    if (!same) this.#limbs = joints.map(({ joint }) => joint);
    return { joints: { names, values: this.#ghost }, limbs: this.#limbs };
  }
}

/** Sizes in radii of the robot. */
const LEAST_RADIUS = 0.07;
const MOST_RADIUS = 0.2;
const THICK = 0.006;
const SPOKE = 0.004;
/** Smaller deviations (rad or m) get no arc. */
const LEAST = 1e-3;

export interface ShownDeviation {
  readonly channel: string;
  readonly error: number;
  readonly unit: string;
  readonly compliant: boolean;
  /** The anchor of its label (world, metres); null if none of its joints is in the model. */
  readonly at: Vec3 | null;
  /** The lines drawn for it (world, metres): from each joint to the middle of its arc, and along the limb. */
  readonly lines: readonly (readonly [Vec3, Vec3])[];
}

/** A ghost of the limbs that deviate from their command, and arcs from their displayed to their other position. */
export class Deviations implements Sign {
  static readonly key = 'deviations';
  static readonly menu = {
    name: { en: 'Limbs off their command', ko: '명령에서 벗어난 관절' },
    explain: 'signs.ghost',
    setting: 'lens',
  } as const;
  readonly drawn: ShownDeviation[] = [];
  ghost: SignGhost | null = null;
  readonly #table: DeviationTable;
  #apart: readonly Deviation[] = [];

  constructor(schema: Schema) {
    this.#table = new DeviationTable(schema);
  }

  static can(schema: Schema): boolean {
    return schema.field('ref') !== null && schema.field('pos') !== null;
  }

  /** With both poses shown, the arcs are on too. */
  static shown({ lens, shown }: SignSettings): boolean {
    return lens || shown === 'both';
  }

  read({ codes, settings: { shown } }: SignFrame): void {
    this.#apart = this.#table.read(codes);
    this.ghost = shown === 'both' ? null : this.#table.ghost(this.#apart, shown);
  }

  draw(picture: SignPicture): void {
    const { live, settings } = picture.frame;
    this.drawn.length = 0;
    for (const { channel, error, unit, compliant, joints } of this.#apart) {
      const line =
        compliant || !live ? { color: picture.colors.muted, through: true } : levelPaint(picture, 'caution');
      let at: Vec3 | null = null;
      const lines: [Vec3, Vec3][] = [];
      for (const { joint, pos, ref } of joints) {
        const way = settings.shown === 'ref' ? pos - ref : ref - pos;
        const arc = drawArc(picture, joint, way, line);
        if (arc === null) continue;
        at ??= arc.middle;
        lines.push(...arc.ends.map((end): [Vec3, Vec3] => [arc.joint, end]));
      }
      this.drawn.push({ channel, error, unit, compliant, at, lines });
    }
  }

  labels({ frame: { settings, language, nameOf } }: SignPicture): SignLabel[] {
    return this.drawn.flatMap(({ channel, error, unit, compliant, at, lines }): SignLabel[] => {
      if (at === null) return [];
      const display = displayOf(unit, settings.angle);
      const off = `${formatNumber(Math.abs(error), coarseDisplay(display)).trim()} ${display.unit}`;
      const name = nameOf(channel);
      return [
        {
          key: `apart-${channel}`,
          text: compliant ? WORDS[language].compliant(name) : WORDS[language].offBy(name, off),
          level: compliant ? 'ok' : 'caution',
          quiet: compliant,
          at,
          lines,
          explain: [compliant ? 'signs.yields' : 'signs.ghost'],
        },
      ];
    });
  }
}

const WORDS = {
  en: {
    offBy: (name: string, by: string) => `${name} ${by} off`,
    compliant: (name: string) => `${name} compliant`,
  },
  ko: {
    offBy: (name: string, by: string) => `${name} ${by} 벗어남`,
    compliant: (name: string) => `${name} 유연 제어`,
  },
} as const;

/** A drawn arc, or the shaft for a prismatic joint: world, metres. */
interface DrawnArc {
  readonly joint: Vec3;
  readonly middle: Vec3;
  /** The ends of the lines that lead from the joint. */
  readonly ends: readonly Vec3[];
}

/** Draws one arc; null if the model has no such joint. */
function drawArc(
  { strokes, body, reach }: SignPicture,
  name: string,
  way: number,
  line: Paint,
): DrawnArc | null {
  const joint = body.joint(name);
  const worldFromLink = joint === undefined ? undefined : body.linkMatrix(joint.link)?.elements;
  if (joint === undefined || worldFromLink === undefined || !Number.isFinite(way)) return null;
  const at = originOf(worldFromLink);
  if (Math.abs(way) < LEAST) return { joint: at, middle: at, ends: [] };
  const axis = directionThrough(worldFromLink, joint.axis);
  if (joint.slides) {
    const along = scale(axis, Math.sign(way));
    strokes.shaft(at, along, Math.abs(way), THICK * reach, THICK * reach, line);
    const end = addScaled(at, along, Math.abs(way));
    return { joint: at, middle: end, ends: [end] };
  }
  const box = body.linkBox(joint.link);
  const limb = limbAcross(axis, box, worldFromLink);
  const size = box === undefined ? 0 : 0.7 * Math.hypot(...addScaled(box.max, box.min, -1));
  const radius = Math.min(MOST_RADIUS * reach, Math.max(LEAST_RADIUS * reach, size));
  strokes.arc(at, axis, limb, way, radius, THICK * reach, line);
  strokes.fan(at, axis, limb, way, 0, radius, { ...line, opacity: 0.34 });
  for (const spoke of [limb, rotateAbout(axis, way, limb)]) {
    strokes.shaft(at, spoke, radius, SPOKE * reach, SPOKE * reach, line);
  }
  const on = (turn: number) => addScaled(at, rotateAbout(axis, turn, limb), radius);
  return { joint: at, middle: on(way / 2), ends: [on(0), on(way / 2), on(way)] };
}

/** If the component of a direction across the axis is shorter than this (squared, unit vectors), it counts as zero. */
const ALONG_AXIS = 0.02;
const DOWN: Vec3 = [0, 0, -1];

/** The direction of the limb that a joint turns, as a unit vector across the joint's axis in the world: towards the middle of the
 *  moved link's box (in its frame, if it has one), else down, else ahead. */
export function limbAcross(
  axis: Vec3,
  box: { readonly min: Vec3; readonly max: Vec3 } | undefined,
  worldFromLink: Transform,
): Vec3 {
  const limb = box && directionThrough(worldFromLink, scale(addScaled(box.min, box.max), 0.5));
  const ways: readonly Vec3[] = [limb ?? DOWN, DOWN, [1, 0, 0]];
  const found = ways.map((way) => rejectFrom(way, axis)).find((way) => dot(way, way) >= ALONG_AXIS);
  return normalize(found ?? [0, 1, 0]);
}
