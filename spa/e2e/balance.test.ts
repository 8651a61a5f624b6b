/** The balance signs: support, cost, and grey for old poses. */

import { expect, it } from 'vitest';
import { COUNT_DRAWS, drawCalls } from './draw_calls.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { hasSkin, is, resting } from './robot_page.ts';
import { choose, DEMO, demoAt, labels, type Moment, shown } from './sign_words.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** Maximum draw calls that balance may add to a picture. */
const MOST_CALLS = 2;
/** The robot stands on both feet. */
const STANDING = demoAt(38);

interface Balance {
  readonly centreOfMass: readonly number[] | null;
  readonly floorM: number | null;
  readonly ground: string | null;
  readonly polygon: readonly (readonly number[])[];
  readonly marginM: number | null;
  readonly level: string;
  readonly pressure: readonly number[] | null;
  readonly feet: readonly { name: string; bears: boolean | null; pressure: unknown; atEdge: boolean }[];
  readonly footprints: number;
  readonly joints: readonly { joint: string; left: number }[];
}

function balance(page: Page): Promise<Balance | null> {
  return page.evaluate<Balance | null>(
    'JSON.parse(JSON.stringify(window.posecast.scene?.signs.balance ?? null))',
  );
}

/** Waits for balance signs that satisfy a condition. */
function balanceWith(page: Page, what: string, holds: (balance: Balance) => boolean): Promise<Balance> {
  return until(what, async () => {
    const now = await balance(page);
    return now !== null && holds(now) ? now : null;
  });
}

async function atRest(page: Page): Promise<void> {
  await until('HOLDING', is(page, 'HOLDING'));
  await until('rest', () => resting(page));
}

/** Raises the robot's right foot, so that its load moves to the left one. */
function onOneFoot({ ftf = {}, ftm = {}, ...moment }: Moment): Moment {
  const of = (part: Record<string, number | null>, site: string, value: number | null) =>
    Object.fromEntries(Object.keys(part).flatMap((key) => (key.startsWith(site) ? [[key, value]] : [])));
  return {
    ...moment,
    ftf: { ...ftf, ...of(ftf, 'RF', 0), 'LF.fz': 420 },
    ftm: { ...ftm, ...of(ftm, 'RF', 0), ...of(ftm, 'LF', 0), 'LF.my': 0.069 * 420 },
  };
}

it('a robot with all its signs of balance', async () => {
  const relay = await stage.stack.relay();
  const { source, edge } = stage.stack.fedEdge(relay, STANDING, DEMO);
  const page = await stage.open(`${relay.url}/#/r/demo`, { preload: COUNT_DRAWS });
  await shown(page);
  await choose(page, { balance: 'off' });
  await until('skin', () => hasSkin(page));
  await atRest(page);
  expect(await balance(page), 'it is off').toBeNull();
  const without = await drawCalls(page);

  await choose(page, { balance: 'auto' });
  await until('skin', () => hasSkin(page));
  const stands = await balanceWith(page, 'a polygon', ({ polygon }) => polygon.length > 3);
  expect(stands).toMatchObject({ ground: 'measured', level: 'ok' });
  expect(stands.feet.map(({ name, bears }) => [name, bears])).toEqual([
    ['RF', true],
    ['LF', true],
  ]);
  expect(stands.centreOfMass?.[2]).toBeGreaterThan(0.5);
  expect(stands.floorM).toBeCloseTo(0, 2);
  expect(stands.pressure).not.toBeNull();
  const mm = Math.round(stands.marginM! * 1000);
  expect(mm).toBeGreaterThan(20);
  await until('the margin in words', async () => (await labels(page)).includes(`margin: ${mm} mm`));

  await atRest(page);
  const withSigns = await drawCalls(page);
  console.log(`draw calls without balance ${without.all}, with it ${withSigns.all}`);
  expect(withSigns.all - without.all, 'the axes are hidden').toBe(MOST_CALLS - 1);

  source.write(JSON.stringify(onOneFoot(STANDING)));
  const lifted = await balanceWith(page, 'one foot', ({ feet }) => feet[0]?.bears === false);
  expect(lifted.level, 'outside of it').not.toBe('ok');
  expect(lifted.marginM).toBeLessThan(0);
  expect(lifted.feet[1], 'on its heel').toMatchObject({ bears: true, atEdge: true });
  expect(lifted.footprints).toBe(1);
  await until('a warning', async () => (await labels(page)).some((label) => /^margin: −\d+ mm$/.test(label)));

  await page.evaluate(`document.querySelector('tr[data-label="RKN"] button').click()`);
  const selected = await balanceWith(page, 'limits', ({ joints }) => joints.length > 0);
  expect(selected.joints.map(({ joint }) => joint)).toEqual(['RKN']);
  expect(selected.joints[0]!.left).toBeGreaterThan(0);

  source.write(JSON.stringify({ ...STANDING, ftf: { ...STANDING.ftf, 'RF.fz': null } }));
  const unread = await balanceWith(page, 'no reading', ({ feet }) => feet[0]?.bears === null);
  expect(unread).toMatchObject({ polygon: [], marginM: null, pressure: null });
  expect(unread.centreOfMass, 'the mass needs no force').not.toBeNull();
  expect((await labels(page)).some((label) => label.startsWith('margin'))).toBe(false);

  source.write(JSON.stringify(STANDING));
  await until('a margin again', async () => (await labels(page)).includes(`margin: ${mm} mm`));
  edge.signal('SIGSTOP');
  await until('an old pose', is(page, 'STALE', 'OFFLINE'));
  await until('a grey label', () =>
    page.evaluate<boolean>(`document.querySelector('[data-sign="margin"]')?.dataset.old === 'true'`),
  );
  edge.signal('SIGCONT');
}, 240_000);
