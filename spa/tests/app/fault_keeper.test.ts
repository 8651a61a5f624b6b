import type { EventMessage } from '@posecast/wire';
import { expect, it } from 'vitest';
import { FaultKeeper } from '../../src/app/state/fault_keeper.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { codesWith, SCHEMA } from '../rigs/schema.ts';

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

it('says nothing of faults until the recorded past is known, and keeps those that only the past has', () => {
  for (const isAcknowledged of [false, true]) {
    const { twin, keeper, frame } = watched();
    keeper.expectPast();
    frame(1);
    expect(keeper.faults(), 'a relay that restarted has no events').toBeNull();
    if (isAcknowledged) {
      twin.acceptEvent(event(1, -180_000, 'on'));
      keeper.acknowledge(keeper.faults()!);
    }
    keeper.recall([event(7, -180_000, 'on'), event(8, -176_000, 'off')]);
    expect(keeper.faults()).toMatchObject(
      isAcknowledged ? [] : [{ source: 'RKN', clearedMs: NOW - 176_000 }],
    );
  }
});

it('forgets the faults of a deleted span, also if the relay repeats their events', () => {
  const { twin, keeper, frame } = watched();
  frame(1);
  const events = [event(1, -50_000, 'on'), event(2, -49_000, 'off')];
  for (const each of [...events, event(3, -20_000, 'on'), event(4, -19_000, 'off')]) twin.acceptEvent(each);
  const spans = [{ fromMs: NOW - 25_000, toMs: NOW - 10_000 }];
  twin.acceptDeleted(spans);
  keeper.forget(spans);
  expect(keeper.faults(), 'it began before').toMatchObject([{ firstMs: NOW - 50_000 }]);
  const all = [{ fromMs: NOW - 60_000, toMs: NOW - 10_000 }];
  twin.acceptDeleted(all);
  keeper.forget(all);
  expect(keeper.faults()).toEqual([]);
  for (const each of events) twin.acceptEvent(each);
  twin.acceptEarlier(events, true);
  expect(twin.events).toEqual([]);
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
