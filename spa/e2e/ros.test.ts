/** A Unitree G1 from its ROS 2 topics to the page, without ROS installed here. */

import { existsSync } from 'node:fs';
import path from 'node:path';
import { describe, it } from 'vitest';
import { until } from './driver/until.ts';
import { poseMatches } from './pose_check.ts';
import { body, shownSeq } from './robot_page.ts';
import { PYTHON, REPO, SHARED } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const ROBOT = path.join(REPO, 'edge-agent/tests/ros_stage.py');
const URDF = path.join(
  SHARED,
  'robots/unitree-g1/example-robot-data/robots/g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf',
);

describe.skipIf(!FULL || !existsSync(URDF))('ros2', () => {
  it('a G1 moves from its joint states to the page', async () => {
    const robot = stage.stack.start('ros', PYTHON, [ROBOT]);
    const [source] = await robot.line(/ros2:\S+/);
    const relay = await stage.stack.relay();
    const tap = stage.stack.tap(relay, 'g1');
    const edge = stage.stack.edge(relay, {
      robot: 'g1',
      source,
      profile: 'g1',
      urdf: URDF,
      meshTools: false,
    });
    const page = await stage.newPage();
    await page.open(`${relay.url}/#/r/g1`);
    await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0, 60_000);
    const first = (await shownSeq(page)) ?? 0;
    await until('newer frames', async () => ((await shownSeq(page)) ?? 0) > first + 30);
    await poseMatches(page, edge, tap, URDF);
  });
});
