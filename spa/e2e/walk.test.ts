import { existsSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { body } from './robot_page.ts';
import { REPO, SHARED } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const URDF = path.join(SHARED, 'robots/hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf');
const TRAJECTORY = path.join(SHARED, 'trajectories/hubo2plus_walk/walking_traj/walkFiveSteps0p2m.traj');
const PROFILE = path.join(REPO, 'edge-agent/src/posecast_edge/profiles/hubo2plus.toml');

describe.skipIf(!FULL || !existsSync(URDF) || !existsSync(TRAJECTORY)).each([
  ['3D', {}],
  ['the light view', { webgl: false }],
])('Hubo 2+ walks in %s', (name, options) => {
  const stage = setStage(options);

  it('lifts its feet in turn, with the other on the floor', async () => {
    const relay = await stage.stack.relay();
    const robot = { robot: 'hubo', source: `trajectory:${TRAJECTORY}`, profile: PROFILE, urdf: URDF };
    stage.stack.edge(relay, robot);
    const page = await stage.newPage();
    page.forgive(/WebGL/); // the browser's own error when a context is requested
    await page.open(`${relay.url}/#/r/hubo`);
    await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0);
    /** Heights, metres, of one instant. */
    const feet: { left: number; right: number }[] = [];
    let knees = 0;
    await until(
      'both feet have been up',
      async () => {
        const now = await body(page);
        const left = now?.links.Body_LAR?.[11];
        const right = now?.links.Body_RAR?.[11];
        if (left === undefined || right === undefined) return false;
        feet.push({ left, right });
        knees = Math.max(knees, await page.evaluate<number>('window.posecast.twin.value("pos", "RKN") ?? 0'));
        return feet.some((at) => at.left - at.right > 0.02) && feet.some((at) => at.right - at.left > 0.02);
      },
      150_000,
    );
    await page.screenshot(`walk-${name.replaceAll(' ', '-')}.png`);
    // one foot is always near the floor: an ankle is about 0.1 m above its sole
    expect(Math.max(...feet.map((at) => Math.min(at.left, at.right)))).toBeLessThan(0.15);
    expect(knees, 'a knee that bends').toBeGreaterThan(0.2);
  }, 200_000);
});
