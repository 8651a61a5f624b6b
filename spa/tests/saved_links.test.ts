import { readFileSync } from 'node:fs';
import { parseSchema } from '@posecast/wire';
import { expect, it } from 'vitest';
import { multiply, transform } from '../src/model/kinematics.ts';
import { readManifest } from '../src/model/manifest.ts';
import { CdrWriter } from '../src/past/save/ros/cdr_writer.ts';
import { DEFINITIONS } from '../src/past/save/ros/definitions.ts';
import { LinkFrames } from '../src/past/save/ros/link_frames.ts';
import { readRosMessage } from './ros_message.ts';

type Seven = [number, number, number, number, number, number, number];

interface Case {
  readonly name: string;
  readonly manifest: Record<string, unknown> & { readonly links: readonly string[] };
  readonly schema: string;
  /** `links`: world_from_link in the manifest's order, metres and a quaternion w, x, y, z. */
  readonly frames: readonly { readonly codes: readonly number[]; readonly links: readonly Seven[] }[];
}

interface Told {
  readonly header: { readonly frame_id: string };
  readonly child_frame_id: string;
  readonly transform: {
    readonly translation: { readonly x: number; readonly y: number; readonly z: number };
    readonly rotation: { readonly w: number; readonly x: number; readonly y: number; readonly z: number };
  };
}

const VECTORS = new URL('../../wire/vectors/link_poses.json', import.meta.url);
const { cases } = JSON.parse(readFileSync(VECTORS, 'utf8')) as { cases: readonly Case[] };

it.each(cases)(
  '$name: /tf leads to where the links are on the page',
  ({ manifest, schema: text, frames }) => {
    const schema = parseSchema(text);
    const links = new LinkFrames(readManifest(manifest));
    const cdr = new CdrWriter();
    frames.forEach(({ codes, links: wanted }, seq) => {
      links.write(cdr, seq * 1e5, schema, Int32Array.from(codes));
      const message = readRosMessage(DEFINITIONS['tf2_msgs/msg/TFMessage'], cdr.bytes);
      const { transforms } = message as unknown as { transforms: readonly Told[] };
      const world = placed(transforms);
      manifest.links.forEach((link, i) => {
        const [x, y, z, ...quat] = wanted[i]!;
        const found = world.get(link);
        transform([x, y, z], quat).forEach((value, at) => {
          expect(found?.[at], `${link} in frame ${seq}`).toBeCloseTo(value, 5);
        });
      });
    });
  },
);

/** world_from_link by the names alone. */
function placed(transforms: readonly Told[]): Map<string, Float64Array> {
  const world = new Map<string, Float64Array>();
  for (const { header, child_frame_id, transform: told } of transforms) {
    const { translation: t, rotation: r } = told;
    const own = transform([t.x, t.y, t.z], [r.w, r.x, r.y, r.z]);
    const parent = world.get(header.frame_id);
    const whole = Float64Array.from(own);
    if (parent !== undefined) multiply(whole, 0, parent, 0, own, 0);
    else expect(header.frame_id).toBe('world');
    world.set(child_frame_id, whole);
  }
  return world;
}
