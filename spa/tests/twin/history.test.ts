import { parseSchema } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { HISTORY_S, History } from '../../src/twin/plots/history.ts';
import { strip } from '../../src/twin/plots/sparkline.ts';
import { codesWith, SCHEMA } from '../rigs/schema.ts';

const state = (atMs: number, changed: Parameters<typeof codesWith>[0]) => ({
  ...{ schemaId: SCHEMA.id, seq: 1, tS: 0, codes: codesWith(changed), freshMs: 0, bornMs: 0, changedMs: 0 },
  atMs,
});

describe('the last minute', () => {
  it('of one channel, oldest first', () => {
    const history = new History();
    for (const [atMs, code] of [
      [0, 100],
      [100, null],
      [200, 300],
    ] as const) {
      history.push(SCHEMA, state(atMs, { 'pos.RKN': code }));
    }
    expect(history.trace('pos', 'RKN', 1200)).toEqual({ agoS: [-1.2, -1.1, -1], values: [0.1, null, 0.3] });
    expect(history.trace('pos', 'nobody', 1200).values).toEqual([]);
    expect(history.trace('vel', 'RKN', 1200).values).toEqual([]);
  });

  it('takes ten a second at most, and forgets what is older than a minute', () => {
    const history = new History();
    for (let n = 0; n < 30 * 90; n += 1) history.push(SCHEMA, state((n * 1000) / 30, { 'pos.RKN': n }));
    const { agoS } = history.trace('pos', 'RKN', 90_000);
    expect(agoS.length).toBeLessThanOrEqual(HISTORY_S * 10);
    expect(agoS.length).toBeGreaterThan(HISTORY_S * 7);
    expect(Math.min(...agoS)).toBeGreaterThanOrEqual(-HISTORY_S);
  });

  it('begins anew with another schema', () => {
    const history = new History();
    history.push(SCHEMA, state(0, {}));
    const other = parseSchema(SCHEMA.text.replace('"Small"', '"Other"'));
    history.push(other, { ...state(100, {}), schemaId: other.id });
    expect(history.trace('pos', 'RKN', 200).agoS).toEqual([-0.1]);
  });
});

describe('a strip', () => {
  it('has all traces on one scale', () => {
    const found = strip(
      [
        { agoS: [-10, 0], values: [0, 1] },
        { agoS: [-5, -4], values: [0.5, 0.5] },
      ],
      ...([100, 20, 10, 0.1] as const),
    );
    expect(found).toEqual({ paths: ['M0 20M100 0', 'M50 10L60 10'], low: 0, high: 1 });
  });

  it('breaks where there was no reading, and keeps a flat line flat', () => {
    const found = strip([{ agoS: [-3, -2, -1, 0], values: [1, null, 1, 1.2] }], 90, 10, 3, 1);
    expect(found?.paths).toEqual(['M0 6M60 6L90 4']);
    expect(found).toMatchObject({ low: expect.closeTo(0.6), high: expect.closeTo(1.6) });
    expect(strip([{ agoS: [0], values: [null] }], 90, 10, 3, 1)).toBeNull();
    const around = strip([{ agoS: [-1, 0, 1], values: [0, 1, 0] }], 90, 10, 2, 1, 1);
    expect(around?.paths).toEqual(['M0 10L45 0L90 10']);
  });
});
