import { existsSync } from 'node:fs';
import path from 'node:path';
import { setTimeout as pause } from 'node:timers/promises';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { body, shownSeq } from './robot_page.ts';
import { REPO, SHARED } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const URDF = path.join(SHARED, 'robots/hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf');
const TRAJECTORY = path.join(SHARED, 'trajectories/hubo2plus_walk/walking_traj/walkFiveSteps0p2m.traj');
const PROFILE = path.join(REPO, 'edge-agent/src/posecast_edge/profiles/hubo2plus.toml');
/** From each side. */
const PICTURES = 3;

/** Heights of the two feet, metres, of one instant. */
interface Feet {
  readonly left: number;
  readonly right: number;
}

describe.skipIf(!FULL || !existsSync(URDF) || !existsSync(TRAJECTORY))('Hubo 2+ walks', () => {
  it('lifts its feet in turn, with the other on the floor; pictures are in e2e/shots', async () => {
    const relay = await stage.stack.relay();
    stage.stack.edge(relay, {
      robot: 'hubo',
      source: `trajectory:${TRAJECTORY}`,
      profile: PROFILE,
      urdf: URDF,
    });
    const page = await stage.newPage();
    await page.open(`${relay.url}/#/r/hubo`);
    await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0, 60_000);

    const feet: Feet[] = [];
    let pictures = 0;
    let knees = 0;
    await until(
      'both feet have been up',
      async () => {
        const now = await body(page);
        const left = now?.links.Body_LAR?.[11];
        const right = now?.links.Body_RAR?.[11];
        if (left === undefined || right === undefined) return false;
        feet.push({ left, right });
        const seq = (await shownSeq(page)) ?? 0;
        if (pictures < 2 * PICTURES && seq > pictures * 10) {
          const side = pictures % 2 === 0 ? 'front' : 'side';
          await page.findByRole('button', side).click();
          await pause(1500); // the camera eases for 250 ms, rendered in software
          await page.screenshot(`walk-${String(pictures++).padStart(2, '0')}-${side}.png`);
        }
        knees = Math.max(knees, await page.evaluate<number>('window.posecast.twin.value("pos", "RKN") ?? 0'));
        const up = (foot: 'left' | 'right', other: 'left' | 'right'): boolean =>
          feet.some((at) => at[foot] - at[other] > 0.02);
        return up('left', 'right') && up('right', 'left') && pictures === 2 * PICTURES;
      },
      150_000,
    );
    // one foot is always near the floor: an ankle is about 0.1 m above its sole
    expect(Math.max(...feet.map((at) => Math.min(at.left, at.right)))).toBeLessThan(0.15);
    expect(knees, 'a knee that bends').toBeGreaterThan(0.2);
  }, 200_000);
});
