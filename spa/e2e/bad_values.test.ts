import path from 'node:path';
import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { body, liveness, resting, shownSeq } from './robot_page.ts';
import { DEMO, demoAt } from './sign_words.ts';
import { forwardKinematics, REPO } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const URDF = path.join(REPO, 'edge-agent/src/posecast_edge/demo_bundle/robot.urdf');
const SIZE = { width: 600, height: 400 };

const note = (page: Page) =>
  page.evaluate<string>('document.querySelector("[data-testid=unread-note]")?.textContent ?? ""');

async function openBody(page: Page, url: string): Promise<void> {
  await page.open(`${url}/#/r/demo`);
  await until(
    'a body',
    async () => (await page.evaluate<number>('window.posecast?.scene?.triangles ?? 0')) > 500,
  );
  await until('at rest', () => resting(page));
}

const shin = async (page: Page) =>
  (await body(page))?.links.Body_RKN ?? Object.values((await body(page))?.links ?? {});

describe('values that make no sense', () => {
  it('a joint without a reading stays where it was and is named; out of every limit it is shown as it is', async () => {
    const relay = await stage.stack.relay();
    const { source } = stage.stack.fedEdge(relay, { pos: { RKN: 0.4, LKN: 0.4 } }, { urdf: URDF });
    const page = await stage.newPage({ viewport: SIZE });
    await openBody(page, relay.url);
    const before = await shin(page);
    const quiet = await note(page);
    source.write(JSON.stringify({ pos: { RKN: Number.NaN, LKN: 0.4 } }).replace('null', 'NaN'));
    await until('it is named', async () => (await note(page)) !== quiet && /RKN/.test(await note(page)));
    await until('at rest', () => resting(page));
    expect(await shin(page)).toEqual(before);
    await page.screenshot('unread.png');

    source.write(JSON.stringify({ pos: { RKN: 40, LKN: 0.4 } }));
    await until('read again', async () => (await note(page)) === quiet);
    await until('at rest', () => resting(page));
    const shown = (await body(page))?.links ?? {};
    const expected = await forwardKinematics(URDF, { RKN: 40, LKN: 0.4 });
    for (const [link, pose] of Object.entries(expected)) {
      for (const [i, value] of pose.entries())
        expect(Math.abs((shown[link]?.[i] ?? 9) - value), link).toBeLessThan(0.001);
    }
    expect(await liveness(page)).toMatch(/LIVE|HOLDING/);
  });

  it('a place that is no place leaves the robot where it was; time that steps back is shown at once', async () => {
    const sample = demoAt(1);
    const at = (x: number | null, turned = 1) => ({
      ...sample,
      base: { ...sample.base, 'base.x': x },
      baseq: { 'base.w': turned, 'base.x': 0, 'base.y': 0, 'base.z': 0 },
    });
    const relay = await stage.stack.relay();
    const { source } = stage.stack.fedEdge(relay, at(0.3), DEMO);
    const page = await stage.newPage({ viewport: SIZE });
    await openBody(page, relay.url);
    const root = async () => Object.values((await body(page))?.links ?? {})[0] ?? [];
    const knee = async () => (await body(page))?.links.Body_RKN?.[11] ?? Number.NaN;
    await until('it stands where it says', async () => Math.abs(((await root())[3] ?? 9) - 0.3) < 1e-3);
    const stood = await root();
    const bentBy = (rad: number) => ({
      pos: { ...sample.pos, ...Object.fromEntries(['RHP', 'RKN', 'RAP'].map((joint) => [joint, rad])) },
    });
    /** The newest sample, which bends the knee, is on the screen. */
    const seen = async (change: object) => {
      const before = await knee();
      source.write(JSON.stringify(change));
      await until('the newest pose', async () => Math.abs((await knee()) - before) > 0.01);
    };
    await seen({ ...at(0.3, 0), ...bentBy(0.9) });
    expect(await root(), 'turned by a quaternion of no length').toEqual(stood);
    await seen({ ...at(null), ...bentBy(0) });
    expect(await root(), 'without a reading').toEqual(stood);
    await seen({ ...at(0.5), ...bentBy(0.9), t: 5 }); // the robot's clock was set back by decades
    await until('its newest place', async () => Math.abs(((await root())[3] ?? 9) - 0.5) < 1e-3);
    expect(await page.evaluate<number>('window.posecast.twin.t_s')).toBeLessThan(6);
    expect(await liveness(page)).toMatch(/LIVE|HOLDING/);
    const all = Object.values((await body(page))?.links ?? {}).flat();
    expect(all.length > 0 && all.every(Number.isFinite)).toBe(true);
  });

  it.skipIf(!FULL)(
    'a robot that comes back with other joints and an earlier clock is shown at once, without a reload',
    async () => {
      const relay = await stage.stack.relay();
      const first = stage.stack.fedEdge(relay, { pos: { RKN: 0.4, LKN: 0.4 } }, { urdf: URDF });
      const page = await stage.newPage({ viewport: SIZE });
      await openBody(page, relay.url);
      await page.evaluate('window.born = true');
      first.edge.signal('SIGKILL');
      page.forgive(/status of 503/); // the page may request its model while it is unavailable
      stage.stack.fedEdge(
        relay,
        { pos: { LEB: -0.9, RKN: 0.8 }, wave: { pos: { RKN: [0.2, 0.5] } }, t: 3 },
        { urdf: URDF },
      );
      const has = (label: string) =>
        page.evaluate<boolean>(`window.posecast.twin.value('pos', '${label}') !== undefined`);
      await until('the new schema', async () => (await has('LEB')) && !(await has('LKN')));
      const seq = (await shownSeq(page)) ?? 0;
      await until('it goes on', async () => ((await shownSeq(page)) ?? 0) > seq + 3);
      const at = JSON.stringify(await shin(page));
      await until('the body moves', async () => JSON.stringify(await shin(page)) !== at);
      expect(await page.evaluate<boolean>('window.born')).toBe(true);
    },
  );
});
