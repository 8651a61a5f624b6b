import { existsSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { setTimeout as pause } from 'node:timers/promises';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { body, renderedFrames } from './robot_page.ts';
import { buildModel, canBuild, SHARED_ROBOTS } from './shared_robots.ts';
import { forwardKinematics } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
const ONE_MM = 0.001;

interface Manifest {
  readonly levels: readonly { path: string }[];
  readonly joints: readonly { name: string; type: string; mimic?: object }[];
}

describe.skipIf(!FULL || !canBuild())(
  'every robot, built (in `make test-full`; skipped where posecast-edge has no `model build`)',
  () => {
    for (const [name, urdf] of Object.entries(SHARED_ROBOTS)) {
      it.skipIf(!existsSync(urdf))(
        `${name} stands as forward kinematics says; pictures are in e2e/shots`,
        async () => {
          const folder = stage.stack.folder();
          buildModel(urdf, folder);
          const relay = await stage.stack.relay();
          const manifest = JSON.parse(readFileSync(path.join(folder, 'manifest.json'), 'utf8')) as Manifest;
          const pos = Object.fromEntries(
            manifest.joints.flatMap(({ name: joint, type, mimic }, i) =>
              type === 'fixed' || mimic !== undefined ? [] : [[joint, 0.4 * Math.sin(12.9 * i)]],
            ),
          );
          stage.stack.builtEdge(relay, { folder }, { pos }, name);
          const page = await stage.newPage();
          await page.open(`${relay.url}/#/r/${name}`);
          await until(
            'skin',
            async () => (await page.evaluate<number>('window.posecast.scene?.triangles ?? 0')) > 1000,
            30_000,
          );
          const joints = await until('a reading', () =>
            page.evaluate<Record<string, number> | null>(
              `window.posecast.twin.seq === null ? null : Object.fromEntries(${JSON.stringify(Object.keys(pos))}.map((j) => [j, window.posecast.twin.value('pos', j)]))`,
            ),
          );
          const expected = await forwardKinematics(urdf, joints, { xyz: [0, 0, 0], quat_wxyz: [1, 0, 0, 0] });
          const [root] = Object.entries(expected)[0] ?? [];
          let apart = Number.NaN;
          await until('the pose', async () => {
            const links = (await body(page))?.links ?? {};
            // another test checks its height; here every link is checked relative to the first
            const lift = (links[root ?? '']?.[11] ?? Number.NaN) - (expected[root ?? '']?.[11] ?? Number.NaN);
            const far = Object.entries(expected).flatMap(([link, pose]) =>
              pose.map((value, at) =>
                Math.abs(value + (at === 11 ? lift : 0) - (links[link]?.[at] ?? Number.NaN)),
              ),
            );
            apart = Math.max(...far);
            return apart <= ONE_MM;
          });
          const second = manifest.levels[1]?.path;
          await until(
            'the second level',
            () => second === undefined || page.requested.some((url) => url.endsWith(`/${second}`)),
          );
          for (const side of ['Reset the view', 'front', 'side', 'top']) {
            const before = await renderedFrames(page);
            await page.findByRole('button', side).click();
            await until('a picture', async () => (await renderedFrames(page)) > before);
            await pause(1500); // the camera eases, in software-rendered pictures
            await page.screenshot(`built-${name}-${side.split(' ').at(-1)}.png`);
          }
          const calls = await page.evaluate<number>('window.posecast.scene.drawCalls');
          console.log(
            `${name}: ${Object.keys(expected).length} links, ${(apart * 1000).toFixed(4)} mm apart, ${calls} draw calls`,
          );
          expect(calls).toBeLessThanOrEqual(5); // floor, axes, shadow, and the robot
        },
      );
    }
  },
);
