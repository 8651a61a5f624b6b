import { existsSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { COUNT_DRAWS, drawCalls } from './draw_calls.ts';
import { until } from './driver/until.ts';
import { body, resting } from './robot_page.ts';
import { buildModel, canBuild, SHARED_ROBOTS } from './shared_robots.ts';
import { type Configuration, manyForwardKinematics } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
const CONFIGURATIONS = 20;
const ONE_MM = 0.001;
/** Few pixels for software rendering. */
const SMALL = { width: 800, height: 480 };
/** A wire code differs by at most this from the sent value, rad or m. */
const CODED = 0.002;
/** The robot, its shadow, the floor and its axes, and one more for pictures on its skin. */
const MOST_CALLS = 5;

interface Manifest {
  readonly levels: readonly { path: string }[];
  readonly joints: readonly { name: string; type: string; mimic?: object }[];
}

/** A reproducible sequence of numbers in −1…1. */
function numbers(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 31 - 1;
  };
}

describe.skipIf(!FULL || !canBuild())('every robot, built', () => {
  it.each(Object.entries(SHARED_ROBOTS).filter(([, urdf]) => existsSync(urdf)))(
    '%s: every link stands where independent forward kinematics puts it, to 1 mm, and it is drawn in few calls',
    async (name, urdf) => {
      const folder = stage.stack.folder();
      buildModel(urdf, folder);
      const { joints, levels } = JSON.parse(
        readFileSync(path.join(folder, 'manifest.json'), 'utf8'),
      ) as Manifest;
      const free = joints.filter(({ type, mimic }) => type !== 'fixed' && mimic === undefined);
      const next = numbers(29);
      const wanted: Configuration[] = Array.from({ length: CONFIGURATIONS }, () =>
        Object.fromEntries(
          free.map(({ name: joint, type }) => [joint, next() * (type === 'prismatic' ? 0.1 : 2.5)]),
        ),
      );
      const relay = await stage.stack.relay();
      const { source } = stage.stack.fedEdge(relay, { pos: wanted[0] }, { robot: name, model: folder });
      const page = await stage.open(`${relay.url}/#/r/${name}`, { viewport: SMALL, preload: COUNT_DRAWS });
      await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0);
      const sent: Configuration[] = [];
      const seen: Readonly<Record<string, readonly number[]>>[] = [];
      for (const pos of wanted) {
        source.write(JSON.stringify({ pos }));
        const values = await until('its readings', async () => {
          const now = await page.evaluate<Record<string, number>>(
            `Object.fromEntries(${JSON.stringify(Object.keys(pos))}.map((j) => [j, window.posecast.twin.value('pos', j)]))`,
          );
          const here = Object.entries(pos).every(([j, q]) => Math.abs((now[j] ?? NaN) - (q ?? NaN)) < CODED);
          return here && (await resting(page)) ? now : null;
        });
        sent.push(values);
        seen.push((await body(page))?.links ?? {});
      }
      const root = { xyz: [0, 0, 0], quat_wxyz: [1, 0, 0, 0] };
      const expected = await manyForwardKinematics(urdf, sent, root);
      let apart = 0;
      for (const [i, links] of expected.entries()) {
        const [first] = Object.keys(links);
        // another test checks its height; here every link is checked relative to the first
        const lift = (seen[i]?.[first ?? '']?.[11] ?? NaN) - (links[first ?? '']?.[11] ?? NaN);
        for (const [link, pose] of Object.entries(links)) {
          for (const [at, value] of pose.entries()) {
            const far = Math.abs(value + (at === 11 ? lift : 0) - (seen[i]?.[link]?.[at] ?? NaN));
            apart = Number.isNaN(far) ? Infinity : Math.max(apart, far);
          }
        }
      }
      expect(apart).toBeLessThanOrEqual(ONE_MM);

      const second = levels[1]?.path;
      await until(
        'the second level',
        () => second === undefined || page.requested.some((url) => url.endsWith(`/${second}`)),
      );
      const { all } = await drawCalls(page);
      console.log(
        `${name}: ${joints.length + 1} links, ${expected.length} configurations, ${(apart * 1e6).toFixed(2)} µm apart, ${all} draw calls`,
      );
      expect(all).toBeLessThanOrEqual(MOST_CALLS);
    },
    300_000,
  );
});
