// @vitest-environment happy-dom
import { afterEach, beforeAll, describe, expect, it, vi } from 'vitest';
import { halfPx, listTicks, roundTimes } from '../../src/app/past/time_line/ticks.ts';
import { msAt, pxAt } from '../../src/app/past/time_line/track_view.ts';
import { changeSettings } from '../../src/app/state/settings.ts';
import { bindLanguage, languageTag } from '../../src/app/text/language.ts';

const MIN = 60_000;
const HOUR = 60 * MIN;
const DAY = 24 * HOUR;
const LENGTHS = [5 * MIN, 30 * MIN, 3 * HOUR, DAY, 7 * DAY];
const WIDTHS = [150, 186, 230, 360, 614, 1366, 3840];
const HOME = process.env.TZ;

/** Time zones: no offset; ahead; behind; with summer time; with one of half an hour; one whose clock changes at midnight. */
const ZONES = {
  UTC: Date.UTC(2026, 10, 22, 14, 30),
  'Asia/Seoul': Date.UTC(2026, 10, 22, 14, 58),
  'America/Los_Angeles': Date.UTC(2026, 10, 1, 12), // summer time ended three hours ago
  'Europe/Berlin': Date.UTC(2026, 2, 29, 3), // it began two hours ago
  'Australia/Lord_Howe': Date.UTC(2026, 9, 3, 20),
  'Asia/Kathmandu': Date.UTC(2026, 10, 22, 14, 30),
  'America/Santiago': Date.UTC(2026, 8, 6, 12), // there was no midnight today
} as const;

function inZone(zone: string | undefined): void {
  if (zone === undefined) delete process.env.TZ;
  else process.env.TZ = zone;
}

function ticksOf(toMs: number, lengthMs: number, widthPx: number, textPx = 12) {
  const view = { fromMs: toMs - lengthMs, toMs, widthPx };
  return { view, ticks: listTicks(view, { pxAt: (atMs) => pxAt(view, atMs), widthPx, textPx }) };
}

const labelsOf = (toMs: number, lengthMs: number, widthPx: number) =>
  ticksOf(toMs, lengthMs, widthPx).ticks.flatMap(({ label }) => label ?? []);

afterEach(() => inZone(HOME));

describe.each(['en', 'ko'] as const)('ticks in %s', (language) => {
  beforeAll(async () => {
    changeSettings({ language });
    await bindLanguage();
    await vi.waitFor(() => expect(languageTag()).toBe(language));
  });

  it.each(Object.entries(ZONES))('never lie over one another, and are never none: %s', (zone, toMs) => {
    inZone(zone);
    for (const widthPx of WIDTHS)
      for (const lengthMs of LENGTHS)
        for (const textPx of [12, 15])
          for (const shiftMs of [0, 5 * HOUR]) {
            const { view, ticks } = ticksOf(toMs + shiftMs, lengthMs, widthPx, textPx);
            const where = `${widthPx} px, ${lengthMs / MIN} min, ${textPx} px, ${shiftMs / MIN}`;
            const labels = ticks.filter(({ label }) => label !== null);
            expect(labels.length, where).toBeGreaterThanOrEqual(1);
            let rightPx = 0;
            for (const { atMs, label } of labels) {
              const [px, half] = [pxAt(view, atMs), halfPx(label!, textPx)];
              expect(px - half, `${where}: ${label}`).toBeGreaterThanOrEqual(rightPx);
              rightPx = px + half + 8;
            }
            expect(rightPx - 8, where).toBeLessThanOrEqual(widthPx);
            const apartPx = ticks
              .slice(1)
              .map(({ atMs }, i) => pxAt(view, atMs) - pxAt(view, ticks[i]!.atMs));
            expect(Math.min(...apartPx, 9), where).toBeGreaterThan(3);
          }
  });
});

describe('round times', () => {
  const clocks = (fromMs: number, hours: number, stepMs: number) =>
    roundTimes({ fromMs, toMs: fromMs + hours * HOUR }, stepMs).map((atMs) =>
      new Date(atMs).toTimeString().slice(0, 5),
    );

  it('are those of the viewer’s clock, in zones that are not whole hours away as well', () => {
    inZone('Asia/Kathmandu');
    expect(clocks(Date.UTC(2026, 10, 22, 14, 30), 6, 3 * HOUR)).toEqual(['21:00', '00:00']);
    inZone('Asia/Seoul');
    expect(clocks(Date.UTC(2026, 10, 22, 14, 30), 12, 6 * HOUR)).toEqual(['00:00', '06:00']);
  });

  it('leave out an hour that there is not, and have one twice that there is twice', () => {
    inZone('Europe/Berlin');
    const begins = Date.UTC(2026, 2, 28, 23); // midnight there
    expect(clocks(begins, 5, HOUR)).toEqual(['00:00', '01:00', '03:00', '04:00', '05:00', '06:00']);
    expect(clocks(begins, 11, 6 * HOUR)).toEqual(['00:00', '06:00', '12:00']);
    expect(clocks(begins, 5, 2 * HOUR)).toEqual(['00:00', '04:00', '06:00']);
    const ends = Date.UTC(2026, 9, 24, 22);
    expect(clocks(ends, 5, HOUR)).toEqual(['00:00', '01:00', '02:00', '02:00', '03:00', '04:00']);
    expect(clocks(ends, 13, 6 * HOUR)).toEqual(['00:00', '06:00', '12:00']);
    inZone('Australia/Lord_Howe');
    expect(clocks(Date.UTC(2026, 9, 3, 14), 3, HOUR)).toEqual(['01:00', '03:00', '04:00']);
  });

  it('are the beginnings of days, also where one has 23 hours or no midnight', () => {
    inZone('America/Santiago');
    const span = { fromMs: Date.UTC(2026, 8, 5), toMs: Date.UTC(2026, 8, 8) };
    const days = roundTimes(span, DAY).map((atMs) => new Date(atMs).toString().slice(4, 21));
    expect(days).toEqual(['Sep 05 2026 00:00', 'Sep 06 2026 01:00', 'Sep 07 2026 00:00']);
    inZone('America/Los_Angeles');
    const week = { fromMs: Date.UTC(2026, 9, 30, 8), toMs: Date.UTC(2026, 10, 4, 8) };
    expect(roundTimes(week, DAY).map((atMs) => new Date(atMs).getHours())).toEqual([0, 0, 0, 0, 0]);
    const apart = roundTimes(week, DAY);
    expect(apart.slice(1).map((atMs, i) => (atMs - apart[i]!) / HOUR)).toEqual([24, 25, 24, 24]);
  });
});

describe('labels', () => {
  beforeAll(async () => {
    changeSettings({ language: 'en' });
    await vi.waitFor(() => expect(languageTag()).toBe('en'));
  });

  it('name the day where one begins, by the viewer’s clock', () => {
    inZone('Asia/Seoul');
    const midnight = Date.UTC(2026, 10, 22, 15);
    expect(labelsOf(midnight + 2 * HOUR, 3 * HOUR, 614)).toContain('23 Nov');
    inZone('America/Los_Angeles');
    expect(labelsOf(Date.UTC(2026, 10, 23, 9), DAY, 614)).toContain('23 Nov');
    expect(labelsOf(Date.UTC(2026, 10, 23, 9), DAY, 614)).toContain('12:00');
  });

  it('are dates alone on a line of days, and seconds on one of seconds', () => {
    inZone('UTC');
    expect(labelsOf(ZONES.UTC, 7 * DAY, 614)).toEqual(
      [16, 17, 18, 19, 20, 21, 22].map((day) => `${day} Nov`),
    );
    expect(labelsOf(ZONES.UTC, MIN, 614)[0]).toMatch(/^14:29:\d\d$/);
  });

  it('keep their step while the line moves on', () => {
    inZone('UTC');
    const steps = new Set<number>();
    for (let shiftMs = 0; shiftMs < 2 * HOUR; shiftMs += 7 * MIN) {
      const labels = ticksOf(ZONES.UTC + shiftMs, 3 * HOUR, 614).ticks.filter(({ label }) => label !== null);
      steps.add(labels[1]!.atMs - labels[0]!.atMs);
    }
    expect(steps.size).toBe(1);
  });
});

it('a place of the line is the moment of its tick', () => {
  const { view, ticks } = ticksOf(ZONES.UTC, DAY, 614);
  for (const { atMs } of ticks) expect(Math.abs(msAt(view, pxAt(view, atMs)) - atMs)).toBeLessThan(1);
});
