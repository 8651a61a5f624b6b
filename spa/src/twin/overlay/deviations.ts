import { JOINT, JointMapping, type Schema } from '@posecast/wire';
import { JointChannels } from '../joint_channels.ts';
import { CLOSE_AGAIN } from '../joints.ts';
import { placeOf } from '../names.ts';
import type { JointValues } from '../playback/pose.ts';
import { valueAt } from '../values.ts';

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

/** The deviating joints where the body does not show them, for a ghost. */
export interface DeviationGhost {
  /** Joints that do not deviate have no value. Overwritten by the next call. */
  readonly joints: JointValues;
  /** The joints that deviate: the same array as long as they are the same joints. */
  readonly limbs: readonly string[];
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
   *  */
  read(codes: Int32Array): Deviation[] {
    const schema = this.#schema;
    const [pos, ref, flags] = [schema.field('pos'), schema.field('ref'), schema.field('flags')];
    let jointsRead = false;
    const apart: Deviation[] = [];
    for (const watched of this.#watched) {
      const { index, tolerance, deviation, at } = watched;
      const is = valueAt(codes, pos, index);
      const told = valueAt(codes, ref, index);
      if (is === null || told === null) {
        watched.apart = false;
        continue;
      }
      deviation.error = told - is;
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
  ghost(apart: readonly Deviation[], shown: 'pos' | 'ref'): DeviationGhost | null {
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
