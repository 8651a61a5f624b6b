import { readFileSync } from 'node:fs';
import { parseSchema } from '@posecast/wire';
import { expect, it } from 'vitest';
import { transform } from '../../src/model/kinematics.ts';
import { readManifest } from '../../src/model/manifest.ts';
import { LIGHT_COLORS } from '../../src/scene/canvas2d/colors.ts';
import { LightRobot } from '../../src/scene/canvas2d/robot.ts';
import { LightRobotNode } from '../../src/scene/canvas2d/robot_node.ts';
import { Player } from '../../src/twin/playback/player.ts';

type Seven = [number, number, number, number, number, number, number];

interface Case {
  readonly name: string;
  readonly manifest: Record<string, unknown>;
  readonly schema: string;
  /** The codes of each frame; `links`: world_from_link in the manifest's order, metres and a quaternion w, x, y, z. */
  readonly frames: readonly { readonly codes: readonly number[]; readonly links: readonly Seven[] }[];
}

const VECTORS = new URL('../../../wire/vectors/link_poses.json', import.meta.url);
const { cases } = JSON.parse(readFileSync(VECTORS, 'utf8')) as { cases: readonly Case[] };

const ignore = () => {};

/** A robot on the page, whichever renderer draws it. */
class Posed extends LightRobotNode {
  constructor(manifest: Record<string, unknown>) {
    super({ tones: () => LIGHT_COLORS.dark, placed: ignore, framed: ignore, changed: ignore });
    this.adopt(new LightRobot(readManifest(manifest), LIGHT_COLORS.dark));
  }
}

it.each(cases)(
  '$name: the page has its links where an export of the past has them',
  ({ manifest, schema: text, frames }) => {
    const schema = parseSchema(text);
    const player = new Player(schema);
    player.raw = true;
    const node = new Posed(manifest);
    const links = manifest.links as string[];
    frames.forEach(({ codes, links: wanted }, seq) => {
      const atMs = seq * 100;
      const times = { tS: seq / 10, freshMs: atMs, bornMs: atMs, changedMs: atMs, atMs };
      player.push({ schemaId: schema.id, seq, codes: Int32Array.from(codes), ...times });
      player.sample(atMs);
      node.setPose(player.pose('pos'), true);
      const poses = node.linkPoses();
      expect(Object.keys(poses)).toEqual(links);
      links.forEach((link, i) => {
        const [x, y, z, ...quat] = wanted[i]!;
        const m = transform([x, y, z], quat);
        poses[link]!.forEach((found, at) => {
          expect(found, `${link} in frame ${seq}`).toBeCloseTo(m[(at % 4) * 4 + Math.floor(at / 4)]!, 5);
        });
      });
    });
  },
);
