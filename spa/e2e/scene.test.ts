import { existsSync } from 'node:fs';
import path from 'node:path';
import { setTimeout as pause } from 'node:timers/promises';
import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import type { Process } from './process.ts';
import { type Body, body, liveness, renderedFrames, shownSeq } from './robot_page.ts';
import { forwardKinematics, REPO, SHARED, type Tap, type TappedFrame } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const EDGE = path.join(REPO, 'edge-agent/src/posecast_edge');
const HUBO_URDF = path.join(SHARED, 'robots/hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf');
const HUBO_WALK = path.join(SHARED, 'trajectories/hubo2plus_walk/walking_traj/walkFiveSteps0p2m.traj');
const ONE_MM = 0.001;

/** Stops the robot's edge and waits until page, scene and tap stand at its last frame. */
async function frozen(page: Page, edge: Process, tap: Tap): Promise<{ shown: Body; sent: TappedFrame }> {
  edge.signal('SIGSTOP');
  let last = -1;
  const shown = await until('the page stands still', async () => {
    const now = await body(page);
    const still = now !== null && now.seq === last && Object.keys(now.links).length > 0;
    last = now?.seq ?? -1;
    return still ? now : null;
  });
  await pause(250); // the frame that is drawn may be one tick behind the frame that is known
  const settled = (await body(page)) ?? shown;
  const sent = await until('the tap has the frame', () => tap.frame(settled.seq));
  edge.signal('SIGCONT');
  return { shown: settled, sent };
}

function baseOf(frame: TappedFrame): unknown {
  const { base, baseq } = frame.values;
  if (base === undefined || baseq === undefined) return null;
  return { xyz: Object.values(base), quat_wxyz: Object.values(baseq) };
}

/** The largest distance between a link's origin here and there, and the largest difference of any rotation entry. */
function apart(
  shown: Body,
  expected: Readonly<Record<string, number[]>>,
): { metres: number; rotation: number } {
  let metres = 0;
  let rotation = 0;
  for (const [link, pose] of Object.entries(expected)) {
    const seen = shown.links[link];
    if (seen === undefined) throw new Error(`the scene has no link ${link}`);
    const moved = [3, 7, 11].map((at) => (seen[at] ?? Number.NaN) - (pose[at] ?? Number.NaN));
    metres = Math.max(metres, Math.hypot(...moved));
    for (const at of [0, 1, 2, 4, 5, 6, 8, 9, 10]) {
      rotation = Math.max(rotation, Math.abs((seen[at] ?? Number.NaN) - (pose[at] ?? Number.NaN)));
    }
  }
  return { metres, rotation };
}

async function poseMatches(page: Page, edge: Process, tap: Tap, urdf: string): Promise<number> {
  const { shown, sent } = await frozen(page, edge, tap);
  const { metres, rotation } = apart(shown, forwardKinematics(urdf, sent.joints, baseOf(sent)));
  expect(metres, `links of frame ${sent.seq}, metres apart`).toBeLessThanOrEqual(ONE_MM);
  expect(rotation, `links of frame ${sent.seq}, rotation apart`).toBeLessThanOrEqual(ONE_MM);
  console.log(
    `frame ${sent.seq}: ${Object.keys(shown.links).length} links, ${(metres * 1000).toFixed(4)} mm apart`,
  );
  return sent.seq;
}

describe('the body', () => {
  it('stands as forward kinematics says: the demo robot', async () => {
    const relay = await stage.stack.relay();
    const tap = stage.stack.tap(relay);
    const edge = stage.stack.edge(relay);
    const page = await stage.newPage();
    await page.open(`${relay.url}/#/r/demo`);
    await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0, 60_000);
    let seq = -1;
    for (let instant = 0; instant < 3; instant++) {
      await until('newer frames', async () => ((await shownSeq(page)) ?? -1) > seq + 30);
      seq = await poseMatches(page, edge, tap, path.join(EDGE, 'demo_bundle/robot.urdf'));
    }
  });

  it.skipIf(!existsSync(HUBO_URDF))('stands as forward kinematics says: Hubo 2+ walking', async () => {
    const relay = await stage.stack.relay();
    const tap = stage.stack.tap(relay, 'hubo');
    const edge = stage.stack.edge(relay, {
      robot: 'hubo',
      source: `trajectory:${HUBO_WALK}`,
      profile: path.join(EDGE, 'profiles/hubo2plus.toml'),
      urdf: HUBO_URDF,
    });
    const page = await stage.newPage();
    await page.open(`${relay.url}/#/r/hubo`);
    await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0, 60_000);
    let seq = -1;
    for (let instant = 0; instant < 3; instant++) {
      await until('newer frames', async () => ((await shownSeq(page)) ?? -1) > seq + 30);
      seq = await poseMatches(page, edge, tap, HUBO_URDF);
    }
  });

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
    await until('HOLDING', async () => (await liveness(page)) === 'HOLDING', 30_000);
    let before = -1;
    await until('the camera has come to rest', async () => {
      const last = before;
      before = await renderedFrames(page);
      await pause(1500); // a picture may take software half a second
      return before === last;
    });
    const seq = await shownSeq(page);
    await pause(2000);
    expect(await renderedFrames(page)).toBe(before);
    expect(await liveness(page)).toBe('HOLDING');
    expect(await shownSeq(page), 'frames still arrive').toBeGreaterThan(seq ?? Number.POSITIVE_INFINITY);
  });
});
