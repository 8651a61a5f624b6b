import { JointMapping, type Schema } from '@posecast/wire';

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
