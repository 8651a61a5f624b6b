/** Real robots from their own programs' protocols to the page, without those programs' libraries here. */

import { existsSync } from 'node:fs';
import path from 'node:path';
import { expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { poseMatches } from './pose_check.ts';
import { body, shownSeq } from './robot_page.ts';
import { PYTHON, REPO, SHARED } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const WALK = path.join(SHARED, 'trajectories/hubo2plus_walk/walking_traj/walkFiveSteps0p2m.traj');
const HUBO = 'hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf';
const G1 = 'unitree-g1/example-robot-data/robots/g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf';
/** The hands' fingers are reported so. */
const HUBO_SAYS = { unit: 'mm', volt: { main: 48 }, ftf: { 'RF.fz': 210, 'LF.fz': 210 } };

it.skipIf(!FULL || !existsSync(WALK)).each([
  ['achd of the 2014 paper', 'hubo2plus', HUBO, ['hubo_stage.py', 'hubo2plus', WALK], HUBO_SAYS],
  [
    'achd, the other robot',
    'drchubo',
    'drchubo-stl/drchubo-urdf/drchubo-v3.urdf',
    ['hubo_stage.py', 'drchubo', WALK],
    { ...HUBO_SAYS, unit: 'rad' },
  ],
  ['ROS 2 topics', 'g1', G1, ['ros_stage.py'], null],
  ['a trajectory', 'hubo2plus', HUBO, null, null],
] as const)(
  'from %s, %s moves to the page, its meshes as they are',
  async (_, profile, model, program, says) => {
    const urdf = path.join(SHARED, 'robots', model);
    let source = `trajectory:${WALK}`;
    if (program !== null) {
      const [script, ...args] = program;
      const running = stage.stack.start('program', PYTHON, [
        path.join(REPO, 'edge-agent/tests', script),
        ...args,
      ]);
      [source] = await running.line(/(hubo-ach|ros2):\S+/);
    }
    const relay = await stage.stack.relay();
    const tap = stage.stack.tap(relay, 'robot');
    const edge = stage.stack.edge(relay, { robot: 'robot', source, profile, urdf, meshTools: false });
    const page = await stage.open(`${relay.url}/#/r/robot`);
    await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0);
    const first = (await shownSeq(page)) ?? 0;
    await until('newer frames', async () => ((await shownSeq(page)) ?? 0) > first + 30);
    await poseMatches(page, edge, tap, urdf);
    if (says === null) return;
    const unit = `document.querySelector('td[data-label=NK1][data-field=pos]').dataset.unit ?? 'rad'`;
    expect(await page.evaluate(unit)).toBe(says.unit);
    expect(tap.newest?.values).toMatchObject({ volt: says.volt, ftf: says.ftf });
  },
);
