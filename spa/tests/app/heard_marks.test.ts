import type { EventMessage } from '@posecast/wire';
import { expect, it } from 'vitest';
import { withHeard } from '../../src/app/past/time_line/movement.ts';
import type { PastSource } from '../../src/past/past_source.ts';
import { listEvents } from '../../src/past/player/tape/happenings.ts';
import { timelineOf } from '../rigs/past_fake.ts';

const TO_MS = Date.UTC(2026, 10, 22, 14, 10);
const MIN = 60_000;

function heardAt(n: number, beforeMs: number, more: Partial<EventMessage> = {}): EventMessage {
  const at = (TO_MS - beforeMs) / 1000;
  return { type: 'event', n, t: 0, at, level: 'fault', source: 'RKN', text: 'jam', state: 'on', ...more };
}
const placesOf = (marks: readonly { atMs: number; exact: boolean }[]) =>
  marks.map(({ atMs, exact }) => [TO_MS - atMs, exact]);

it('what was heard stands at its moment, in place of the minutes that tell of it', () => {
  const timeline = timelineOf(TO_MS, 10, [
    { atMs: TO_MS - 5 * MIN, exact: false, count: 2 },
    { atMs: TO_MS - 2 * MIN, exact: false },
  ]);
  const heard = [
    heardAt(7, 4.5 * MIN),
    heardAt(8, 3.5 * MIN, { state: 'off' }),
    heardAt(9, 1.5 * MIN, { level: 'info' }),
    heardAt(10, 1.2 * MIN),
    heardAt(11, 20_000, { level: 'caution' }),
  ];
  // the first minute started before the first event heard, so it stays
  expect(placesOf(withHeard(timeline, heard).marks)).toEqual([
    [5 * MIN, false],
    [1.2 * MIN, true],
    [20_000, true],
  ]);
});

it('what the index tells exactly is not marked twice, and where nothing is new the line is the same', () => {
  const timeline = timelineOf(TO_MS, 10, [{ atMs: TO_MS - 30_000 }]);
  expect(withHeard(timeline, [heardAt(1, 30_400)])).toBe(timeline);
  expect(withHeard(timeline, [])).toBe(timeline);
  expect(withHeard(timeline, [heardAt(1, 11 * MIN), heardAt(2, 30_400)])).toBe(timeline);
  expect(withHeard(timeline, [heardAt(1, 30_400, { text: 'hot' })]).marks).toHaveLength(2);
});

it('where events are lacking, minutes before the gap stay', () => {
  const timeline = timelineOf(TO_MS, 10, [{ atMs: TO_MS - 3 * MIN, exact: false }]);
  const heard = [heardAt(1, 8 * MIN), heardAt(5, MIN)];
  expect(placesOf(withHeard(timeline, heard).marks)).toEqual([
    [3 * MIN, false],
    [MIN, true],
  ]);
});

it('what was heard is listed before a segment has it, and once', () => {
  const recorded = { ...heardAt(1, MIN), atMs: TO_MS - MIN };
  const source = { segmentsIn: () => [{ events: [recorded] }] } as unknown as PastSource;
  const span = { fromMs: TO_MS - 2 * MIN, toMs: TO_MS };
  const heard = [heardAt(0, 3 * MIN), heardAt(1, MIN), heardAt(2, 5000), heardAt(3, 4000, { at: null })];
  expect(listEvents(source, heard, span).map(({ n, atMs }) => [n, TO_MS - atMs])).toEqual([
    [1, MIN],
    [2, 5000],
  ]);
});
