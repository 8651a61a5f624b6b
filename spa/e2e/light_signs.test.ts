/** The signs drawn about a robot, in a browser without 3D. */

import { expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { drawsNothing, is, there } from './robot_page.ts';
import { choose, DEMO, demoAt, labels, shown, signs } from './sign_words.ts';
import { setStage } from './stage.ts';

const stage = setStage({ webgl: false });

it('the light view has the signs of the 3D view: ghost, arc, forces, level, load; an unchanged robot costs nothing', async () => {
  const jammed = demoAt(42);
  const relay = await stage.stack.relay();
  const { source } = stage.stack.fedEdge(relay, demoAt(38), DEMO);
  const page = await stage.newPage();
  page.forgive(/WebGL/);
  await page.open(`${relay.url}/#/r/demo`);
  await shown(page);
  const still = await until('forces', async () => {
    const now = await signs(page);
    return now.wrenches.length === 4 ? now : null;
  });
  expect(still.ghostLinks).toEqual([]);
  expect(still.level.planeZ).not.toBeNull();
  expect(still.level.feet).toEqual(['RF', 'LF']);
  expect(await page.findByTestId('level').text()).toMatch(/roll.*rad/s);

  const triangles = () => page.evaluate<number>('window.posecast.scene.triangles');
  await until('shells', async () => (await triangles()) > 500);
  source.write(JSON.stringify(jammed));
  const found = await until('a ghost', async () => {
    const now = await signs(page);
    return now.ghostLinks.length > 0 ? now : null;
  });
  expect(found.deviations.map(({ channel }) => channel)).toEqual(['RKN']);
  expect(found.ghostLinks).toContain('Body_RAR');
  expect(found.ghostLinks).not.toContain('Body_LAR');
  expect(await labels(page)).toContainEqual(expect.stringMatching(/^apart-RKN: RKN 0\.\d+ rad off$/));

  await choose(page, { shown: 'both', load: 'temp', palette: 'safe' });
  await until('a whole ghost', async () => (await signs(page)).ghostLinks.includes('Body_Torso'));
  await until('colours', async () => Object.keys((await signs(page)).loads).length > 10);
  source.write(JSON.stringify({ ...jammed, temp: { ...jammed.temp, RKN: 71 } }));
  await until('past its limit', async () => (await signs(page)).loads.Body_RKN === '#d55e00');
  await choose(page, { shown: 'pos', load: 'off', palette: 'standard' });
  await until('own colours', async () => Object.keys((await signs(page)).loads).length === 0);
  const hurts = { ...jammed, ftf: { ...jammed.ftf, 'RF.fz': 900 } };
  source.write(JSON.stringify(hurts));
  await until('too much force', async () => {
    const foot = (await signs(page)).wrenches.find(({ site }) => site === 'RF');
    return foot?.force?.level === 'fault';
  });

  await until('HOLDING', is(page, 'HOLDING'));
  await drawsNothing(page, 4);
});

it('the light view says balance in words and numbers, draws the other signs as without it, and says so in the menu', async () => {
  const relay = await stage.stack.relay();
  stage.stack.fedEdge(relay, demoAt(38), DEMO);
  const page = await stage.newPage();
  page.forgive(/WebGL/);
  await page.open(`${relay.url}/#/r/demo`);
  await shown(page);
  await until('its sentence', there(page, 'balance-line'));
  expect(await page.findByTestId('balance-line').text()).toMatch(/\d+\smm/);
  const { level } = await signs(page);
  expect(await page.evaluate('window.posecast.scene.signs.balance')).toBeNull();
  expect(level.feet).toEqual(['RF', 'LF']);
  expect(level.planeZ).not.toBeNull();
  expect((await labels(page)).filter((label) => /^margin/.test(label))).toEqual([]);
  await page.findByRole('button', 'signs').click();
  await until('the entry', there(page, 'balance-entry'));
  expect(await page.findByTestId('balance-entry').text()).toMatch(/Only the 3D view draws its signs/);
});
