import { afterEach, describe, expect, it } from 'vitest';
import { listIncidents, newestHole } from '../../src/app/past/jump/incident_list.ts';
import {
  dayOf,
  listDays,
  listHours,
  nearestRecorded,
  unknownOf,
} from '../../src/app/past/jump/recorded_days.ts';
import { ALL, arrowMs, scaleFor, scaleIn, scalesOf } from '../../src/app/past/time_line/line.ts';
import type { PastEvent, Timeline } from '../../src/past/past_types.ts';
import { timelineOf } from '../rigs/past_fake.ts';

const MIN = 60_000;
const HOUR = 60 * MIN;
const DAY = 24 * HOUR;
const NOON = Date.UTC(2026, 10, 22, 12);
const HOME = process.env.TZ;
afterEach(() => {
  if (HOME === undefined) delete process.env.TZ;
  else process.env.TZ = HOME;
});

const line = (spans: readonly (readonly [number, number])[], more: Partial<Timeline> = {}): Timeline => ({
  ...timelineOf(NOON, 31 * 1440),
  movement: spans.map(([fromMs, toMs]) => ({ fromMs, toMs, bytesPerS: 1 })),
  ...more,
});
const clock = (atMs: number) => new Date(atMs).toString().slice(0, 21);

describe('scales', () => {
  it('are as many as the past is long, the last of them all of it or a week', () => {
    expect(scalesOf(4 * MIN)).toEqual([ALL]);
    expect(scalesOf(30 * MIN)).toEqual([5 * MIN, ALL]);
    expect(scalesOf(2 * HOUR)).toEqual([5 * MIN, 30 * MIN, ALL]);
    expect(scalesOf(30 * DAY)).toEqual([5 * MIN, 30 * MIN, 3 * HOUR, DAY, 7 * DAY]);
  });

  it('are hours by themselves where minutes can’t show all', () => {
    expect(scaleIn(30 * MIN, null)).toBe(ALL);
    expect(scaleIn(3 * HOUR, null)).toBe(ALL);
    expect(scaleIn(30 * DAY, null)).toBe(3 * HOUR);
    expect(scaleIn(25 * MIN, null, true), 'on a phone').toBe(5 * MIN);
    expect(scaleIn(5 * MIN, null, true)).toBe(ALL);
  });

  it('stay what was chosen as far as there is such', () => {
    expect(scaleIn(30 * DAY, DAY)).toBe(DAY);
    expect(scaleIn(30 * MIN, DAY)).toBe(5 * MIN);
    expect(scaleIn(30 * MIN, ALL)).toBe(ALL);
    expect(scaleFor(scalesOf(30 * DAY), 80_000)).toBe(5 * MIN);
  });

  it('make arrow keys go as far as can be seen', () => {
    expect([5 * MIN, 30 * MIN, 3 * HOUR, DAY, 7 * DAY].map(arrowMs)).toEqual([
      ...[1000, 1000, 10_000, MIN, 10 * MIN],
    ]);
  });
});

describe('days', () => {
  it('are the viewer’s: one of UTC lies in two of those who are ahead', () => {
    process.env.TZ = 'Asia/Seoul';
    const late = Date.UTC(2026, 10, 20, 14, 30); // 23:30 there
    expect(listDays(line([[late, late + HOUR]])).map(clock)).toEqual([
      'Sat Nov 21 2026 00:00',
      'Fri Nov 20 2026 00:00',
    ]);
    process.env.TZ = 'America/Los_Angeles';
    expect(listDays(line([[late, late + HOUR]])).map(clock)).toEqual(['Fri Nov 20 2026 00:00']);
  });

  it('count what is not known yet, and tell it apart', () => {
    process.env.TZ = 'UTC';
    const unknown = [{ fromMs: NOON - 2.5 * DAY, toMs: NOON - 1.5 * DAY }];
    const timeline = line([[NOON - HOUR, NOON]], { unknown });
    expect(listDays(timeline).map(clock)).toEqual(['Sun Nov 22 2026 00:00', 'Fri Nov 20 2026 00:00']);
    expect(unknownOf(timeline, dayOf(NOON - 2 * DAY))).toEqual(unknown);
    expect(unknownOf(timeline, dayOf(NOON))).toEqual([]);
  });

  it('have the hours that were recorded, with their faults', () => {
    process.env.TZ = 'Asia/Kathmandu'; // 5:45 ahead
    const begins = Date.UTC(2026, 10, 22, 3, 30); // 9:15 there
    const marks = [
      { atMs: begins + MIN, level: 'fault', source: '', text: '', exact: false, count: 3 },
      { atMs: begins + 2 * MIN, level: 'caution', source: '', text: '', exact: true },
      { atMs: begins + HOUR, level: 'fault', source: '', text: '', exact: true },
    ] as const;
    const timeline = line([[begins, begins + 100 * MIN]], { marks });
    const hours = listHours(timeline, dayOf(begins));
    expect(
      hours.map(({ fromMs, atMs, faults }) => [clock(fromMs).slice(16), clock(atMs).slice(16), faults]),
    ).toEqual([
      ['09:00', '09:15', 3],
      ['10:00', '10:00', 1],
    ]);
  });

  it('have 23 hours or 25 where the clock changes', () => {
    process.env.TZ = 'Europe/Berlin';
    const all = line([[NOON - 300 * DAY, NOON]], { fromMs: NOON - 300 * DAY });
    expect(listHours(all, dayOf(Date.UTC(2026, 2, 29, 12)))).toHaveLength(23);
    expect(listHours(all, dayOf(Date.UTC(2026, 9, 25, 12)))).toHaveLength(25);
  });
});

it('what is nearest is the moment itself where it was recorded, else the end of a gap', () => {
  const timeline = line([
    [NOON - 3 * HOUR, NOON - 2 * HOUR],
    [NOON - HOUR, NOON],
  ]);
  expect(nearestRecorded(timeline, NOON - 150 * MIN)).toBe(NOON - 150 * MIN);
  expect(nearestRecorded(timeline, NOON - 100 * MIN)).toBe(NOON - 2 * HOUR);
  expect(nearestRecorded(timeline, NOON - 80 * MIN)).toBe(NOON - HOUR);
  expect(nearestRecorded(line([]), NOON)).toBeNull();
});

describe('the last faults', () => {
  const told = (n: number, agoS: number, more: Partial<PastEvent> = {}): PastEvent => ({
    ...{ type: 'event', n, t: 1, at: NOON / 1000 - agoS, atMs: NOON - agoS * 1000 },
    ...{ level: 'fault', source: 'RKN', text: 'jam', state: 'on', ...more },
  });
  const list = (events: readonly PastEvent[], more: Partial<Timeline> = {}, sinceMs = 0) =>
    listIncidents({ eventsIn: () => events, nowMs: NOON }, line([], more), sinceMs);

  it('come newest first, with how long they lasted and how often they came lately', () => {
    const events = [
      told(1, 2000),
      told(2, 1990, { state: 'off' }),
      told(3, 500),
      told(4, 496.5, { state: 'off' }),
      told(5, 400, { level: 'caution' }),
      told(6, 300, { source: 'LKN' }),
      told(7, 100),
    ];
    expect(list(events).map(({ event, lastedMs, times }) => [event.n, lastedMs, times])).toEqual([
      [7, null, 2],
      [6, null, 1],
      [3, 3500, 1],
      [1, 10_000, 1],
    ]);
  });

  it('are fifty at most, none before what is known without a hole', () => {
    const events = Array.from({ length: 70 }, (_, i) => told(i, 70 - i));
    expect(list(events)).toHaveLength(50);
    expect(list(events, {}, NOON - 9500)).toHaveLength(9);
  });

  it('do not tell how often where not all is known', () => {
    const fault = { level: 'fault', source: '', text: '', exact: false, count: 2 } as const;
    const times = (more: Partial<Timeline>) => list([told(1, 60)], more)[0]!.times;
    expect(times({})).toBe(1);
    expect(times({ marks: [{ ...fault, atMs: NOON - 5 * MIN }] })).toBeNull();
    expect(times({ marks: [{ ...fault, atMs: NOON - 20 * MIN }] })).toBe(1);
    expect(times({ unknown: [{ fromMs: NOON - DAY, toMs: NOON - 9 * MIN }] })).toBeNull();
  });

  it('have the newest hole filled first: a day, or the minutes of one', () => {
    const fault = { level: 'fault', source: '', text: '', exact: false } as const;
    const marks = [
      { ...fault, atMs: NOON - 3 * HOUR },
      { ...fault, atMs: NOON - HOUR },
    ];
    const unknown = [{ fromMs: NOON - 26 * HOUR, toMs: NOON - 2 * HOUR }];
    const timeline = line([], { marks, unknown });
    const [first, second] = [NOON - HOUR, NOON - 26 * HOUR];
    expect(newestHole(timeline, new Set())).toMatchObject({ kind: 'minutes', atMs: first });
    expect(newestHole(timeline, new Set([first]))).toMatchObject({
      kind: 'day',
      atMs: second,
      untilMs: NOON - 2 * HOUR,
    });
    expect(newestHole(line([]), new Set())).toBeNull();
  });
});
