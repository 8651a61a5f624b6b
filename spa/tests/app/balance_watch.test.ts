import { beforeEach, describe, expect, it, vi } from 'vitest';
import { spokenStance } from '../../src/app/balance/BalanceView.tsx';
import {
  type BalanceWatch,
  balanceOf,
  balanceTraces,
  stanceShown,
  VALUES,
} from '../../src/app/balance/balance_watch.ts';
import { onOwnAlarms, ownAlarms } from '../../src/app/state/own_alarms.ts';
import { bodySigns, type RobotLink } from '../../src/app/state/robot_link.ts';
import { changeSettings } from '../../src/app/state/settings.ts';
import { lacksOf } from '../../src/twin/balance/lacks.ts';
import { History } from '../../src/twin/plots/history.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { type BalanceCase, readBalanceCases } from '../rigs/balance_vectors.ts';

/** The answer for a manifest, by address. */
const manifests = new Map<string, unknown>();
vi.mock('../../src/model/files.ts', () => ({
  manifestAt: async (url: string) => {
    if (!manifests.has(url)) throw new Error('no answer');
    return manifests.get(url);
  },
}));

const cases = readBalanceCases();
const named = (name: string): BalanceCase => cases.find((one) => one.name.startsWith(name))!;

let robots = 0;

/** A robot of a case, with its watch once the model has loaded. `show`: passes it the states of the case. */
async function robotOf({ manifest, schema, frames }: BalanceCase) {
  robots += 1;
  const twin = new RobotTwin(`r${robots}`, 0);
  const manifestUrl = (hash: string) => `/${twin.robot}/${hash}`;
  manifests.set(manifestUrl('m'), manifest.raw);
  const link = { twin, manifestUrl } as RobotLink;
  twin.acceptSchema(schema);
  twin.acceptModel('m');
  const watch = balanceOf(link);
  await vi.waitFor(() => expect(manifests.size).toBeGreaterThan(0));
  await Promise.resolve();
  const show = (i: number, atMs = 1000 + i * 100) => {
    const { t, codes } = frames[i]!;
    twin.acceptState({
      ...{ schemaId: schema.id, seq: i, tS: t, codes: Int32Array.from(codes), atMs },
      ...{ freshMs: atMs, bornMs: atMs, changedMs: atMs },
    });
    return watch.known();
  };
  await vi.waitFor(() => expect(show(0)).not.toBeNull());
  return { twin, link, watch, show };
}

const margins = (watch: BalanceWatch) => watch.known()?.stance?.marginMm ?? null;

beforeEach(() => changeSettings({ balance: 'auto' }));

/** The missing data according to the watch; undefined before it knows anything. */
function lacksNow(watch: BalanceWatch) {
  const known = watch.known();
  return known === null
    ? undefined
    : lacksOf(known.balance, known.findings, known.problems).map(({ why }) => why);
}

describe('the watch over balance', () => {
  it('tells of the pose on the screen, which may be an older one, while pictures come', async () => {
    const one = named('leans until');
    const { watch, show, link, twin } = await robotOf(one);
    show(one.frames.length - 1);
    const newest = watch.known()!.stance!;
    expect(stanceShown(link), 'without a body').toEqual(newest);
    const stance = { ...newest, marginMm: 25 };
    const drawn = { stance, tS: twin.state!.tS - 1 };
    const now = vi.spyOn(performance, 'now').mockReturnValue(1_000_000);
    const body = bodySigns(link);
    body.signs = { drawn: { balance: drawn } };
    expect(stanceShown(link)).toBe(stance);
    now.mockReturnValue(1_005_000);
    expect(stanceShown(link), 'no pictures any more').toEqual(newest);
    drawn.tS = twin.state!.tS;
    expect(stanceShown(link), 'it stands still').toBe(stance);
    body.signs = { drawn: { balance: null } };
    expect(stanceShown(link), 'balance is not drawn').toEqual(newest);
    now.mockRestore();
  });

  it('follows the newest numbers, as the vectors have them', async () => {
    const one = named('leans until');
    const { watch, show, link } = await robotOf(one);
    for (const [i, { balance }] of one.frames.entries()) {
      show(i);
      const expected = balance.margin_m === null ? null : balance.margin_m * 1000;
      if (expected === null) expect(margins(watch)).toBeNull();
      else expect(margins(watch)).toBeCloseTo(expected, 1);
    }
    expect(watch.isShown, 'it stands on two feet that measure').toBe(true);
    expect(watch.known()?.possible).toBe(true);
    expect(lacksNow(watch)).toEqual([]);
    expect(spokenStance(link)?.text).not.toBe('');
  });

  it('notes crossings of the page’s limit once each, and tells who listens', async () => {
    const one = named('leans until');
    const { twin, show, link } = await robotOf(one);
    const heard = vi.fn();
    onOwnAlarms(twin, heard);
    const outside = one.frames.findIndex(({ balance }) => (balance.margin_m ?? 1) < 0);
    expect(outside).toBeGreaterThan(0);
    for (let i = 0; i <= outside; i += 1) show(i);
    show(outside, 5000);
    show(0, 6000);
    const told = ownAlarms(twin).map(({ source, side, limit, state, own }) => [
      source,
      side,
      limit,
      state,
      own,
    ]);
    expect(told).toEqual([
      ['Balance margin', 'below', '0 mm', 'on', false],
      ['Balance margin', 'below', '0 mm', 'off', false],
    ]);
    expect(heard).toHaveBeenCalledTimes(2);
    expect(spokenStance(link)?.gist).toContain('ok');
  });

  it('while it is switched off nothing is told or noted', async () => {
    const one = named('leans until');
    const { twin, watch, show, link } = await robotOf(one);
    changeSettings({ balance: 'off' });
    for (const i of one.frames.keys()) show(i);
    expect(watch.isShown).toBe(false);
    expect(spokenStance(link)).toBeNull();
    expect(ownAlarms(twin)).toEqual([]);
  });

  it('is computed at most ten times a second', async () => {
    const { show, watch } = await robotOf(named('stands'));
    show(1, 2000);
    const known = watch.known();
    expect(show(0, 2030)).toBe(known);
    expect(show(0, 2100)).not.toBe(known);
    expect(show(1, 500), 'back in time').not.toBe(known);
  });

  it.each([
    ['has no masses', ['no-masses'], true, false],
    ["has masses that can't be", ['impossible-masses'], true, false],
    ['an older bundle', ['old-bundle'], false, false],
    ['its profile says it stands on nothing', ['no-feet'], true, false],
    ['has no soles', ['no-feet'], true, false],
    ['has no wrenches', ['no-pressure'], true, false],
    ['sensors measure force alone', ['no-pressure'], true, true],
    ['moments in a unit that nobody knows', ['no-pressure'], true, true],
    ['sensors measure fz, mx and my', [], true, true],
    ['stands', [], true, true],
  ])('%s: what is lacking, and whether it is shown by itself', async (name, lacks, possible, byItself) => {
    const { watch } = await robotOf(named(name));
    expect(lacksNow(watch)).toEqual(lacks);
    expect([watch.known()?.possible, watch.isShownByItself]).toEqual([possible, byItself]);
    changeSettings({ balance: 'on' });
    expect(watch.isShown).toBe(true);
  });

  it('of a model of raw files it says so; without a model it knows nothing', async () => {
    const { schema, frames } = named('stands');
    const twin = new RobotTwin('raw', 0);
    manifests.set('/raw', { v: 1 });
    const link = { twin, manifestUrl: (hash: string) => `/${hash}` } as RobotLink;
    const watch = balanceOf(link);
    twin.acceptSchema(schema);
    const codes = Int32Array.from(frames[0]!.codes);
    const at = { freshMs: 0, bornMs: 0, changedMs: 0, atMs: 1 };
    twin.acceptState({ schemaId: schema.id, seq: 1, tS: 0, codes, ...at });
    expect(watch.known()).toBeNull();
    twin.acceptModel('raw');
    await vi.waitFor(() => expect(lacksNow(watch)).toEqual(['raw']));
    expect(watch.known()?.possible, 'the picture has the ball').toBe(true);
    twin.acceptModel(null);
    expect(watch.known(), 'the model has gone').toBeNull();
  });
});

describe('traces of balance', () => {
  it('have the numbers of the last minute, none where there is none', async () => {
    const one = named('leans until');
    const { link, show } = await robotOf(one);
    show(0);
    const traces = balanceTraces(link);
    expect(balanceTraces(link)).toBe(traces);
    expect(traces.reading({ field: 'pos', label: 'margin' })).toBeNull();
    const readings = VALUES.map((value) => traces.reading(value)!);
    expect(readings.map(({ title, unit }) => `${title} ${unit}`)).toContain('Balance: margin mm');
    const history = new History();
    for (const [i, { codes }] of one.frames.entries())
      history.push(one.schema, { codes: Int32Array.from(codes), atMs: i * 100 });
    while (traces.update(history, one.frames.length * 100));
    for (const [i, { balance, codes }] of one.frames.entries()) {
      const values = readings.map(({ read }) => read(Int32Array.from(codes), i * 100));
      expect(values[0]).toBeCloseTo((balance.margin_m ?? Number.NaN) * 1000, 1);
      expect(values[1]).toBeCloseTo(balance.centre_of_mass_m![0]!, 4);
      if (balance.centre_of_pressure_m === null) expect(values[4]).toBeNull();
      else expect(values[4]).toBeCloseTo(balance.centre_of_pressure_m[0]!, 4);
    }
    expect(readings[0]!.read(new Int32Array(), undefined)).toBeNull();
  });

  it('of a robot without masses have no margin', async () => {
    const one = named('has no masses');
    const { link } = await robotOf(one);
    const traces = balanceTraces(link);
    const history = new History();
    history.push(one.schema, { codes: Int32Array.from(one.frames[0]!.codes), atMs: 0 });
    traces.update(history, 0);
    expect(traces.reading(VALUES[0]!)!.read(new Int32Array(), 0)).toBeNull();
  });
});
