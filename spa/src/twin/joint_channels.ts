import { JointMapping, type Schema } from '@posecast/wire';

/** Which channels move which joints of the model: the mapping, looked up from either end. */
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

  /** URDF joints in whose sum the channel stands with a gain other than zero. */
  jointsOf(channel: string): readonly string[] {
    return this.#jointsOf.get(channel) ?? [];
  }

  /** The channel that moves a URDF joint most, the first of several that do so alike; null when none does. */
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
