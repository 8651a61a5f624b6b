import type { EventMessage } from '@posecast/wire';
import { expect, it } from 'vitest';
import { FaultKeeper } from '../src/app/state/fault_keeper.ts';
import { RobotTwin } from '../src/twin/robot.ts';
import { codesWith, SCHEMA } from './schema.ts';

const NOW = 1_800_000_000_000;
const BEHIND_MS = 4300;

function watched() {
  const twin = new RobotTwin('small', NOW);
  let nowMs = NOW;
  const keeper = new FaultKeeper(twin, () => nowMs - BEHIND_MS, false);
  twin.acceptSchema(SCHEMA);
  const frame = (seq: number) =>
    twin.acceptState({
      ...{ schemaId: SCHEMA.id, seq, tS: seq, codes: codesWith({}), freshMs: nowMs, bornMs: nowMs },
      ...{ changedMs: nowMs, atMs: nowMs },
    });
  const at = (ms: number) => {
    nowMs = NOW + ms;
  };
  return { twin, keeper, frame, at };
}

const event = (n: number, atMs: number, state: 'on' | 'off'): EventMessage => ({
  ...({ type: 'event', n, t: n, at: (NOW + atMs) / 1000 } as const),
  ...({ level: 'fault', source: 'RKN', text: 'jam', state } as const),
});

it('says nothing of faults while it is not known what was before, and none only then', () => {
  const { twin, keeper, frame } = watched();
  expect(keeper.faults()).toBeNull();
  twin.acceptEarlier([], false);
  frame(1);
  expect(keeper.faults(), 'the index of before is on its way').toBeNull();
  twin.acceptEarlier([], true);
  expect(keeper.faults()).toEqual([]);
});

it('tells faults that are known though others may not be, and counts those that are told late', () => {
  const { twin, keeper, frame, at } = watched();
  twin.acceptEarlier([], false);
  frame(1);
  twin.acceptEvent(event(5, -8000, 'on'));
  twin.acceptEvent(event(6, -7000, 'off'));
  expect(keeper.faults()).toMatchObject([{ source: 'RKN', clearedMs: NOW - 7000 }]);
  at(10_000);
  const before = [event(1, -70_000, 'on'), event(2, -69_000, 'off')];
  twin.acceptEarlier([...before, event(3, -40_000, 'on'), event(4, -39_000, 'off')], true);
  expect(keeper.faults()).toMatchObject([{ source: 'RKN', clearedMs: NOW - 7000 }]);
  const { key } = keeper.faults()![0]!;
  expect(keeper.log.occurrences.times(key, keeper.nowMs())).toBe(3);
  expect(keeper.log.occurrences.newestMs(key)).toBe(NOW - 8000);
});

it('counts by the moment that is shown: what a frame shows began then, and is over then', () => {
  const { twin, keeper, frame, at } = watched();
  for (let i = 0; i < 11; i++) {
    const atMs = 60_000 * i;
    at(atMs + BEHIND_MS);
    twin.acceptEvent(event(2 * i + 1, atMs, 'on'));
    frame(i);
    const { key } = keeper.faults()![0]!;
    expect(keeper.nowMs() - keeper.log.occurrences.newestMs(key)!, 'now, not for 4 s').toBe(0);
    expect(keeper.log.occurrences.times(key, keeper.nowMs())).toBe(Math.min(10, i + 1));
    twin.acceptEvent(event(2 * i + 2, atMs + 1000, 'off'));
  }
});
