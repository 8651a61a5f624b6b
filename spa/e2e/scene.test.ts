import { existsSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { poseMatches } from './pose_check.ts';
import { body, drawsNothing, finest, is, liveness, renderedFrames, resting, shownSeq } from './robot_page.ts';
import { REPO, SHARED } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const EDGE = path.join(REPO, 'edge-agent/src/posecast_edge');
const HUBO_URDF = path.join(SHARED, 'robots/hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf');
const HUBO_WALK = path.join(SHARED, 'trajectories/hubo2plus_walk/walking_traj/walkFiveSteps0p2m.traj');

describe('the body', () => {
  it.skipIf(!FULL || !existsSync(HUBO_URDF))(
    'stands as forward kinematics says: Hubo 2+ walking, its meshes as they are',
    async () => {
      const relay = await stage.stack.relay();
      const tap = stage.stack.tap(relay, 'hubo');
      const edge = stage.stack.edge(relay, {
        robot: 'hubo',
        source: `trajectory:${HUBO_WALK}`,
        profile: path.join(EDGE, 'profiles/hubo2plus.toml'),
        urdf: HUBO_URDF,
        meshTools: false,
      });
      const page = await stage.newPage();
      await page.open(`${relay.url}/#/r/hubo`);
      await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0, 60_000);
      let seq = -1;
      for (let instant = 0; instant < 3; instant++) {
        await until('newer frames', async () => ((await shownSeq(page)) ?? -1) > seq + 30);
        seq = await poseMatches(page, edge, tap, HUBO_URDF);
      }
    },
  );

  it('draws nothing while nothing changes, and says HOLDING', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(
      relay,
      { pos: { RKN: 0.3, LKN: 0.3 } },
      { urdf: path.join(EDGE, 'demo_bundle/robot.urdf') },
    );
    const page = await stage.newPage();
    await page.open(`${relay.url}/#/r/demo`);
    await until('a body', async () => (await renderedFrames(page)) > 0, 60_000);
    await until('HOLDING', is(page, 'HOLDING'), 30_000);
    await until('the camera has come to rest', () => resting(page));
    await until('the finest shells', () => finest(page), 60_000);
    await until('at rest again', () => resting(page));
    await drawsNothing(page, 10); // one each half second
    expect(await liveness(page)).toBe('HOLDING');
  });
});
