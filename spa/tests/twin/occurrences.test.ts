import { expect, it } from 'vitest';
import { Occurrences, TIMES_LIMIT, WINDOW_MS } from '../../src/twin/alarms/occurrences.ts';

const AT_MS = 1_800_000_000_000;

it('an occurrence counts once, whether a frame or its event came first', () => {
  for (const frameFirst of [true, false]) {
    const log = new Occurrences();
    if (frameFirst) log.addFrame('a', AT_MS + 40, AT_MS + 40);
    log.addEvent('a', AT_MS, AT_MS + 50);
    if (!frameFirst) log.addFrame('a', AT_MS + 60, AT_MS + 60);
    expect([log.times('a', AT_MS + 100), log.newestMs('a')]).toEqual([1, AT_MS]);
  }
});

it('each event counts, however short the pause, and none when it is told again', () => {
  const log = new Occurrences();
  for (const again of [0, 1]) {
    for (const ms of [0, 60, 120]) log.addEvent('a', AT_MS + ms, AT_MS + 200 + again);
  }
  expect([log.times('a', AT_MS + 300), log.newestMs('a')]).toEqual([3, AT_MS + 120]);
});

it('frames alone count, too, and only the last ten minutes do', () => {
  const log = new Occurrences();
  log.addFrame('a', AT_MS, AT_MS);
  log.addFrame('a', AT_MS + 60_000, AT_MS + 60_000);
  expect(log.times('a', AT_MS + 60_000)).toBe(2);
  expect(log.times('a', AT_MS + WINDOW_MS)).toBe(1);
  expect(log.times('a', AT_MS + 2 * WINDOW_MS)).toBe(0);
  expect(log.newestMs('b')).toBeNull();
});

it('what is kept is bounded, of one fault and of many', () => {
  const log = new Occurrences();
  for (let i = 1; i <= 100; i += 1) log.addEvent('a', AT_MS + i, AT_MS + i);
  expect(log.times('a', AT_MS + 100)).toBe(TIMES_LIMIT);
  for (let i = 0; i < 1000; i += 1) log.addEvent(`b${i}`, AT_MS + i, AT_MS + i);
  expect(log.newestMs('a')).toBeNull();
  expect(log.newestMs('b499')).toBeNull();
  expect(log.newestMs('b500')).toBe(AT_MS + 500);
});
