/** Both robots of the 2014 paper, from their own daemon's protocol to the page. */

import { existsSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { poseMatches } from './pose_check.ts';
import { body, shownSeq } from './robot_page.ts';
import { PYTHON, REPO, SHARED } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const WALK = path.join(SHARED, 'trajectories/hubo2plus_walk/walking_traj/walkFiveSteps0p2m.traj');
const DAEMON = path.join(REPO, 'edge-agent/tests/hubo_stage.py');
const ROBOTS = {
  hubo2plus: 'robots/hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf',
  drchubo: 'robots/drchubo-stl/drchubo-urdf/drchubo-v3.urdf',
};

describe.skipIf(!FULL || !existsSync(WALK))('hubo-ach', () => {
  it.each(Object.entries(ROBOTS))('%s walks from achd to the page', async (profile, model) => {
    const urdf = path.join(SHARED, model);
    const daemon = stage.stack.start('achd', PYTHON, [DAEMON, profile, WALK]);
    const [source] = await daemon.line(/hubo-ach:\S+/);
    const relay = await stage.stack.relay();
    const tap = stage.stack.tap(relay, 'hubo');
    const edge = stage.stack.edge(relay, { robot: 'hubo', source, profile, urdf, meshTools: false });
    const page = await stage.newPage();
    await page.open(`${relay.url}/#/r/hubo`);
    await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0, 60_000);
    const first = (await shownSeq(page)) ?? 0;
    await until('newer frames', async () => ((await shownSeq(page)) ?? 0) > first + 30);
    await poseMatches(page, edge, tap, urdf);
    const unit = `document.querySelector('td[data-label=NK1][data-field=pos]').dataset.unit ?? 'rad'`;
    expect(await page.evaluate(unit)).toBe(profile === 'hubo2plus' ? 'mm' : 'rad');
    const sent = tap.newest?.values;
    expect(sent?.volt).toEqual({ main: 48 });
    expect(sent?.ftf).toMatchObject({ 'RF.fz': 210, 'LF.fz': 210 });
  });
});
