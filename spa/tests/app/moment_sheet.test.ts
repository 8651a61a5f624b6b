// @vitest-environment happy-dom
import { describe, expect, it, vi } from 'vitest';
import { MomentSheet } from '../../src/app/past/jump/MomentSheet.tsx';
import { chooseOn, chosenOn } from '../../src/app/past/time_line/line.ts';
import type { PastEvent } from '../../src/past/past_types.ts';
import { nowMs } from '../../src/stream/clock.ts';
import type { RobotTwin } from '../../src/twin/robot.ts';
import { mount } from '../rigs/mounted.ts';
import { FakePast, timelineOf } from '../rigs/past_fake.ts';

HTMLDialogElement.prototype.showModal ??= function showModal(this: HTMLDialogElement) {
  this.open = true;
};

/** Waits until a check passes, even on a busy machine. */
const until = <T>(check: () => T) => vi.waitFor(check, 10_000);

const MIN = 60_000;
const DAY = 1440 * MIN;
const TWIN = { schema: null, robot: 'demo' } as unknown as RobotTwin;

async function sheet(past: FakePast) {
  chooseOn(past, { isJumpOpen: true });
  const { host, find: wait } = mount(MomentSheet, { controls: past, twin: TWIN });
  await wait('dialog');
  const find = <T extends HTMLElement>(selector: string) => host.querySelector<T>(selector)!;
  const type = async (testId: string, value: string) => {
    const field = find<HTMLInputElement>(`[data-testid=${testId}]`);
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value')!.set!.call(field, value);
    field.dispatchEvent(new Event('input', { bubbles: true }));
    field.dispatchEvent(new Event('change', { bubbles: true }));
    await until(() => expect(field.value).toBe(value));
  };
  const hint = () => find('[data-testid=moment-hint]').textContent ?? '';
  return { host, find, type, hint };
}

const two = (value: number) => String(value).padStart(2, '0');
const dateOf = (atMs: number) => {
  const at = new Date(atMs);
  return `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}`;
};
const timeOf = (atMs: number) => new Date(atMs).toTimeString().slice(0, 8);

/** Three days, each with its last two hours recorded; the newest ends now. */
function threeDays(unknown = false) {
  const now = Math.floor(nowMs() / MIN) * MIN - 53_000; // a field for a time leaves out seconds that are 0
  const spans = [2, 1, 0].map((ago) => ({
    fromMs: now - ago * DAY - 120 * MIN,
    toMs: now - ago * DAY,
    bytesPerS: 1,
  }));
  const timeline = {
    ...timelineOf(now, 3 * 1440),
    movement: unknown ? spans.slice(1) : spans,
    ...(unknown ? { unknown: [{ fromMs: now - 3 * DAY, toMs: now - 1.5 * DAY }] } : {}),
  };
  return { now, spans, past: new FakePast(now, timeline) };
}

describe('going to a moment', () => {
  it('has inputs with labels and with what is kept as bounds, and goes there', async () => {
    const { now, past } = threeDays();
    const { find, type, hint } = await sheet(past);
    const date = find<HTMLInputElement>('[data-testid=moment-date]');
    expect([date.min, date.max]).toEqual([dateOf(now - 3 * DAY), dateOf(now)]);
    expect([...document.querySelectorAll('.moment-form label')].map((label) => label.textContent)).toEqual([
      'Date',
      'Time',
    ]);
    const wanted = now - DAY - 30 * MIN;
    await type('moment-date', dateOf(wanted));
    await type('moment-time', timeOf(wanted));
    await until(() => expect(hint()).toBe('This moment was recorded.'));
    find('[data-testid=moment-go]').click();
    await until(() => expect(past.told).toContain(`open ${(now - wanted) / 1000}`));
    expect(chosenOn(past).get().isJumpOpen).toBe(false);
  });

  it('says what is nearest where nothing was recorded, and goes there', async () => {
    const { now, spans, past } = threeDays();
    const { find, type, hint } = await sheet(past);
    const wanted = now - DAY + 60 * MIN;
    await type('moment-date', dateOf(wanted));
    await type('moment-time', timeOf(wanted));
    await until(() => expect(hint()).toMatch(/^Nothing was recorded then. The nearest is /));
    expect(hint()).toContain(timeOf(spans[1]!.toMs));
    find('[data-testid=moment-go]').click();
    await until(() => expect(past.told.at(-1)).toBe(`open ${(now - spans[1]!.toMs) / 1000}`));
  });

  it('says of what is to come, of what is no longer kept and of no moment that they are so', async () => {
    const { now, past } = threeDays();
    const { find, type, hint } = await sheet(past);
    const go = find<HTMLButtonElement>('[data-testid=moment-go]');
    await type('moment-date', dateOf(now + 2 * DAY));
    await until(() => expect(hint()).toBe('That is in the future.'));
    expect(go.disabled).toBe(true);
    await type('moment-date', dateOf(now - 9 * DAY));
    await until(() => expect(hint()).toMatch(/^That is no longer kept. The oldest is /));
    expect(go.disabled).toBe(false);
    await type('moment-date', '');
    await until(() => expect(hint()).toMatch(/^Kept from .* to .*, in your time zone\.$/));
    expect(go.disabled).toBe(true);
  });

  it('fetches the day of what was typed, once', async () => {
    const { now, past } = threeDays(true);
    past.answerDay = () => false;
    const { type, hint } = await sheet(past);
    past.told.length = 0;
    await type('moment-date', dateOf(now - 2.2 * DAY));
    await until(() => expect(hint()).toMatch(/^Checking/));
    await until(() => expect(past.told.filter((told) => told.startsWith('day'))).toHaveLength(1));
    await until(() => expect(hint(), 'it can’t be had').not.toMatch(/^Checking/));
  });

  it('is two taps away for an hour of yesterday', async () => {
    const { now, spans, past } = threeDays();
    const { find } = await sheet(past);
    const hours = [...document.querySelectorAll<HTMLElement>('.moment-hours')];
    expect(hours, 'of today and yesterday').toHaveLength(2);
    const { fromMs } = spans[1]!;
    const wanted = [...find('[data-testid=moment-days]').querySelectorAll('button')].filter((button) =>
      button.getAttribute('aria-label')?.includes('yesterday'),
    );
    expect(wanted.length).toBeGreaterThan(0);
    wanted[0]!.click();
    await until(() => expect(past.told.at(-1)).toMatch(/^open /));
    const agoS = Number(past.told.at(-1)!.slice(5));
    expect(agoS).toBeLessThanOrEqual((now - fromMs) / 1000);
  });
});

describe('the last faults', () => {
  const told = (n: number, atMs: number, state: 'on' | 'off' = 'on'): PastEvent => ({
    ...{ type: 'event', n, t: 1, at: atMs / 1000, atMs, level: 'fault', source: 'RKN', text: 'jam', state },
  });
  const chooseFaults = () => document.querySelectorAll<HTMLElement>('.moment-ways input')[1]!.click();
  const rows = () => [...document.querySelectorAll<HTMLElement>('.incidents li button')];

  it('are listed with a sentence, when, how long and how often, and lead to two seconds before', async () => {
    const { now, past } = threeDays();
    past.events = [told(1, now - 300_000), told(2, now - 290_000, 'off'), told(3, now - 100_000)];
    await sheet(past);
    chooseFaults();
    await until(() => expect(rows()).toHaveLength(2));
    const [newest, older] = rows();
    const plain = (row: HTMLElement) => row.textContent!.replace(/[\u2066-\u2069]/g, '');
    expect(plain(newest!)).toMatch(/\d\d:\d\d:\d\d.*RKN.*jam.*2nd time in 10 min/);
    expect(plain(older!)).toMatch(/for 10 s/);
    older!.click();
    await until(() => expect(past.told.at(-1)).toBe('seek 302'));
    expect(chosenOn(past).get().isJumpOpen).toBe(false);
  });

  it('have what is missing fetched, newest first, some at a time, and say so when the relay is away', async () => {
    const { now, past } = threeDays();
    const hole = { level: 'fault', source: '', text: '', exact: false } as const;
    let marks = Array.from({ length: 12 }, (_, i) => ({ ...hole, atMs: now - (12 - i) * 10 * MIN }));
    past.timeline = { ...past.timeline!, marks };
    past.answerEvents = (momentMs) => {
      marks = marks.filter(({ atMs }) => atMs !== momentMs);
      past.events.push(told(momentMs, momentMs));
      past.timeline = { ...past.timeline!, marks };
      past.set({});
      return true;
    };
    await sheet(past);
    chooseFaults();
    await until(() => expect(rows()).toHaveLength(8));
    expect(past.told.filter((each) => each.startsWith('events'))).toHaveLength(8);
    past.answerEvents = () => false;
    const more = await until(() => {
      const button = document.querySelector<HTMLElement>('[data-testid=more-incidents]');
      if (button === null) throw new Error('no button');
      return button;
    });
    more.click();
    await until(() =>
      expect(document.querySelector('.incidents [role=status]')?.textContent).toMatch(/does not answer/),
    );
    expect(rows()).toHaveLength(8);
  });

  it('are none where there were none, which is said', async () => {
    const { past } = threeDays();
    await sheet(past);
    chooseFaults();
    await until(() =>
      expect(document.querySelector('.incidents [role=status]')?.textContent).toMatch(/^No fault/),
    );
  });
});
