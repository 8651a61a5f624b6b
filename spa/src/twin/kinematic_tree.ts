import { JointMapping, type Schema } from '@posecast/wire';

/** A link of the model, its parent link and the joint between them. */
export interface TreeLink {
  readonly link: string;
  /** null for the root. */
  readonly parent: string | null;
  /** The joint that moves it; null for the root and for a link fixed to its parent. */
  readonly joint: string | null;
}

/** Which joint moves which links, for any kind of model. Names are those of the URDF. */
export class KinematicTree {
  readonly #links: ReadonlyMap<string, TreeLink>;
  readonly #linkOf: ReadonlyMap<string, string>;

  constructor(links: readonly TreeLink[]) {
    this.#links = new Map(links.map((entry) => [entry.link, entry]));
    this.#linkOf = new Map(links.flatMap(({ joint, link }) => (joint === null ? [] : [[joint, link]])));
  }

  /** Movable joints, parents before children. */
  get joints(): readonly string[] {
    return [...this.#linkOf.keys()];
  }

  /** The child link of a joint, whose origin is at the joint; null for a joint that the model lacks. */
  linkOf(joint: string): string | null {
    return this.#linkOf.get(joint) ?? null;
  }

  /** The links that a joint moves as one rigid body: its child link and all links fixed to it. */
  bodyOf(joint: string): string[] {
    return [...this.#links.keys()].filter((link) => this.jointOf(link) === joint);
  }

  /** The joint that moves a link or the link it is fixed to; null if no joint moves it. */
  jointOf(link: string): string | null {
    const entry = this.#links.get(link);
    if (entry === undefined) return null;
    return entry.joint ?? (entry.parent === null ? null : this.jointOf(entry.parent));
  }

  /** The next joint on the way to the root; null if there is none. */
  before(joint: string): string | null {
    const parent = this.#links.get(this.linkOf(joint) ?? '')?.parent ?? null;
    return parent === null ? null : this.jointOf(parent);
  }
}

/** Looks up which of the robot's channels move which joints of the URDF model, in both directions. */
export class JointChannels {
  readonly #jointsOf = new Map<string, string[]>();
  readonly #channelOf = new Map<string, { channel: string; gain: number }>();

  constructor(schema: Schema) {
    const fields = ['pos', 'ref'].filter((name) => schema.field(name) !== null);
    const joints = new Set(fields.flatMap((name) => new JointMapping(schema, name).joints));
    for (const joint of joints) {
      const terms = schema.mapping.joints.get(joint)?.terms ?? ([[joint, 1]] as const);
      for (const [channel, gain] of terms) this.#add(joint, channel, Math.abs(gain));
    }
  }

  /** URDF joints that the channel contributes to with a non-zero gain. */
  jointsOf(channel: string): readonly string[] {
    return this.#jointsOf.get(channel) ?? [];
  }

  /** The channel with the largest gain for a URDF joint, the first of equal ones; null if there is none. */
  channelOf(joint: string): string | null {
    return this.#channelOf.get(joint)?.channel ?? null;
  }

  #add(joint: string, channel: string, gain: number): void {
    if (gain === 0) return;
    const joints = this.#jointsOf.get(channel) ?? [];
    joints.push(joint);
    this.#jointsOf.set(channel, joints);
    if (gain > (this.#channelOf.get(joint)?.gain ?? 0)) this.#channelOf.set(joint, { channel, gain });
  }
}

/** The names of the robot's positions if none of them moves any of these joints of a model; null if one does, or if there is
 *  nothing to compare. A planar or floating joint has several readings, with its name before the last slash. */
export function listUnmoving(schema: Schema, joints: readonly string[]): readonly string[] | null {
  const fields = ['pos', 'ref'].filter((name) => schema.field(name) !== null);
  const sent = [...new Set(fields.flatMap((name) => new JointMapping(schema, name).joints))];
  if (sent.length === 0 || joints.length === 0) return null;
  const known = new Set(joints);
  const moves = (name: string) => known.has(name) || known.has(name.replace(/\/[^/]*$/, ''));
  return sent.some(moves) ? null : sent;
}
