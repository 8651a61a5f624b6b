import type { EventMessage } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import {
  acknowledgedText,
  FAULT_LIMIT,
  FaultLog,
  readAcknowledged,
  STALLED_AFTER_MS,
} from '../../src/twin/alarms/fault_log.ts';
import { JointTable } from '../../src/twin/joints.ts';
import { codesWith, SCHEMA } from '../rigs/schema.ts';

const JAM = 4;
/** Both clocks agree here, unless a test says otherwise. */
const AT_S = 1_800_000_000;
const AT_MS = AT_S * 1000;

const event = (n: number, state: 'on' | 'off', atS: number, text = 'jam'): EventMessage => ({
  type: 'event',
  n,
  t: 0,
  at: atS,
  level: 'fault',
  source: 'RKN',
  text,
  state,
});
const rows = (mask = 0, temp = 30) =>
  new JointTable(SCHEMA).read(codesWith({ 'flags.RKN': mask, 'temp.RKN': temp }));
const seen = (log: FaultLog) =>
  log.faults.map(({ source, what, words, firstMs, clearedMs, acknowledged }) => [
    `${source} ${words || what}`,
    firstMs - AT_MS,
    clearedMs === null ? null : clearedMs - AT_MS,
    acknowledged,
  ]);

describe('faults are kept', () => {
  it('when only events tell of them: 30 ms, at 1 Hz', () => {
    const log = new FaultLog();
    log.rows(rows(), AT_MS - 500);
    log.event(event(1, 'on', AT_S), AT_MS);
    log.event(event(2, 'off', AT_S + 0.03), AT_MS + 30);
    log.rows(rows(), AT_MS + 500);
    expect(seen(log)).toEqual([['RKN jam', 0, expect.closeTo(30), false]]);
    expect(log.of('RKN')?.words).toBe('jam');
  });

  it('when only frames tell of them', () => {
    const log = new FaultLog();
    log.rows(rows(JAM), AT_MS);
    expect(seen(log)).toEqual([['RKN jam', 0, null, false]]);
    log.rows(rows(), AT_MS + 4000);
    expect(seen(log)).toEqual([['RKN jam', 0, 4000, false]]);
  });

  it('once, when both do, in either order', () => {
    for (const frameFirst of [true, false]) {
      const log = new FaultLog();
      log.rows(rows(), AT_MS - 100);
      if (frameFirst) log.rows(rows(JAM), AT_MS);
      log.event(event(1, 'on', AT_S + 0.01), AT_MS + 10);
      if (!frameFirst) log.rows(rows(JAM), AT_MS + 20);
      log.event(event(2, 'off', AT_S + 3), AT_MS + 3000);
      log.rows(rows(), AT_MS + 3010);
      expect(seen(log)).toEqual([['RKN jam', frameFirst ? 0 : 10, 3010, false]]);
    }
  });

  it('lasting ones first', () => {
    const log = new FaultLog();
    log.rows(rows(JAM), AT_MS);
    log.rows(rows(), AT_MS + 10);
    log.rows(rows(0, 90), AT_MS + 20);
    expect(log.faults.map(({ what, words }) => words || what)).toEqual(['temp', 'jam']);
  });
});

describe('acknowledging', () => {
  it('takes away what is over, and quiets what lasts until it is over', () => {
    const log = new FaultLog();
    log.rows(rows(JAM), AT_MS);
    log.rows(rows(0, 90), AT_MS + 10);
    log.acknowledge(log.faults.map((fault) => fault.key));
    expect(seen(log)).toEqual([['RKN temp', 10, null, true]]);
    expect(log.of('RKN')).toBeNull();
    log.rows(rows(), AT_MS + 20);
    expect(seen(log)).toEqual([]);
  });

  it('holds for that rise only', () => {
    const log = new FaultLog();
    log.rows(rows(JAM), AT_MS);
    log.acknowledge(log.faults.map((fault) => fault.key));
    log.rows(rows(), AT_MS + 10);
    log.rows(rows(JAM), AT_MS + 20);
    expect(seen(log)).toEqual([['RKN jam', 20, null, false]]);
  });

  it('survives a reload, though the relay tells its last events again', () => {
    const first = new FaultLog();
    first.event(event(1, 'on', AT_S), AT_MS);
    first.rows(rows(JAM), AT_MS + 20);
    first.acknowledge(first.faults.map((fault) => fault.key));

    const second = new FaultLog(readAcknowledged(acknowledgedText(first.acknowledged)));
    second.event(event(1, 'on', AT_S), AT_MS + 9000);
    second.rows(rows(JAM), AT_MS + 9010);
    expect(seen(second)).toEqual([['RKN jam', 0, null, true]]);
    second.rows(rows(), AT_MS + 9020);
    second.event(event(3, 'on', AT_S + 10), AT_MS + 10_000);
    expect(seen(second)).toEqual([['RKN jam', 10_000, 10_000, false]]);
  });

  it('reads whatever storage holds', () => {
    expect(readAcknowledged(null).size).toBe(0);
    expect(readAcknowledged('{"a":1}').size).toBe(0);
    expect(readAcknowledged('[["a",1],["b"],[2,3],"x",["c",null]]')).toEqual(new Map([['a', 1]]));
    expect(readAcknowledged('not JSON').size).toBe(0);
  });
});

it('cautions are not kept, and memory is bounded', () => {
  const log = new FaultLog();
  log.event({ ...event(1, 'on', AT_S), level: 'caution' }, AT_MS);
  expect(log.faults).toEqual([]);
  for (let n = 0; n < 2 * FAULT_LIMIT; n += 1) log.event(event(n, 'on', AT_S + n, `bit ${n}`), AT_MS);
  expect(log.faults.length).toBe(FAULT_LIMIT);
});

describe('a joint that stalls without a flag', () => {
  const ENABLED = 3;
  /** Its tolerance is 0.05 rad. */
  const off = (millirad: number, mask = ENABLED) =>
    ({ 'pos.RKN': 0, 'ref.RKN': millirad, 'flags.RKN': mask }) as const;
  const watch = (acknowledged?: string) => {
    const log = new FaultLog(readAcknowledged(acknowledged ?? null));
    const table = new JointTable(SCHEMA);
    const look = (ms: number, changed: ReturnType<typeof off>) => {
      log.rows(table.read(codesWith(changed)), AT_MS + ms);
      return log.faults.map(({ source, level, what, firstMs, acknowledged: quiet }) =>
        [source, level, what, firstMs - AT_MS, quiet].join(' '),
      );
    };
    return { log, look };
  };

  it('is told as a caution once that has lasted, since it began, and no longer', () => {
    const { look, log } = watch();
    expect(look(0, off(300))).toEqual([]);
    expect(look(STALLED_AFTER_MS - 1, off(300))).toEqual([]);
    expect(look(STALLED_AFTER_MS, off(-300))).toEqual(['RKN caution apart 0 false']);
    expect(log.of('RKN'), 'no fault').toBeNull();
    expect(look(STALLED_AFTER_MS + 1, off(45)), 'nearly back').toHaveLength(1);
    expect(look(STALLED_AFTER_MS + 2, off(35)), 'it is not kept').toEqual([]);
    expect(look(STALLED_AFTER_MS + 3, off(300))).toEqual([]);
  });

  it('is none when it lags behind in passing, yields on purpose, has no power, or nobody saw it meanwhile', () => {
    const { look } = watch();
    for (let ms = 0; ms < 10_000; ms += 500) {
      expect(look(ms, off(ms % 2000 === 0 ? 0 : 300)), 'in passing').toEqual([]);
    }
    for (let ms = 10_000; ms < 20_000; ms += 500) expect(look(ms, off(300, 1)), 'without power').toEqual([]);
    look(20_000, off(300));
    expect(look(26_000, off(300)), 'a pause of six seconds').toEqual([]);
    expect(look(28_000, off(300))).toHaveLength(1);
  });

  it('stands behind faults, and a flag of its own says more', () => {
    const { look } = watch();
    look(0, off(300));
    expect(look(3000, off(300, ENABLED | JAM))).toEqual(['RKN fault flag 3000 false']);
    expect(look(3100, off(300)), 'over, and still off its command').toEqual([
      'RKN fault flag 3000 false',
      'RKN caution apart 0 false',
    ]);
  });

  it('is quiet once acknowledged, also after a reload, until it is over', () => {
    const { look, log } = watch();
    look(0, off(300));
    look(3000, off(300));
    log.acknowledge(log.faults.map(({ key }) => key));
    expect(look(3100, off(300))).toEqual(['RKN caution apart 0 true']);
    const next = watch(acknowledgedText(log.acknowledged));
    next.look(0, off(300));
    expect(next.look(3000, off(300))).toEqual(['RKN caution apart 0 true']);
    expect(next.look(3100, off(0))).toEqual([]);
    expect(next.log.acknowledged.size).toBe(0);
    next.look(3200, off(300));
    expect(next.look(6000, off(300))).toEqual(['RKN caution apart 3200 false']);
  });
});

describe('of many', () => {
  it('that which lasts longest comes first, then of those that are over the one that rose last', () => {
    const log = new FaultLog();
    log.rows(rows(), AT_MS);
    for (const [n, text, s] of [
      [1, 'encError', 0],
      [3, 'jam', 10],
      [5, 'encError', 20],
    ] as const) {
      log.event(event(n, 'on', AT_S + s, text), AT_MS + s * 1000);
      log.event(event(n + 1, 'off', AT_S + s + 0.03, text), AT_MS + s * 1000 + 30);
    }
    expect(log.faults.map(({ words }) => words)).toEqual(['enc error', 'jam']);
    const { key } = log.faults[0]!;
    expect(log.occurrences.newestMs(key)).toBe(AT_MS + 20_000);
    expect(log.occurrences.times(key, AT_MS + 30_000)).toBe(2);
    log.rows(rows(0, 90), AT_MS + 30_000);
    expect(log.faults[0]?.what).toBe('temp');
  });

  it('each rise counts, also of one that was acknowledged and rises again', () => {
    const log = new FaultLog();
    log.rows(rows(JAM), AT_MS);
    log.rows(rows(), AT_MS + 2000);
    log.acknowledge(log.faults.map((fault) => fault.key));
    log.rows(rows(JAM), AT_MS + 4000);
    log.rows(rows(JAM), AT_MS + 4030);
    const { key } = log.faults[0]!;
    expect(log.occurrences.times(key, AT_MS + 5000)).toBe(2);
    expect(log.occurrences.newestMs(key)).toBe(AT_MS + 4000);
  });
});
