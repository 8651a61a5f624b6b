import fc from 'fast-check';
import { describe, expect, it } from 'vitest';
import { FAULTS, type Fault, World } from './outage_sim.ts';

const SETTLED_MS = 4000;
const QUIET_MS = 90_000; // longer than any wait between two tries

const fault = fc.record({
  what: fc.constantFrom(...FAULTS),
  atMs: fc.integer({ min: SETTLED_MS, max: 20_000 }),
  forMs: fc.integer({ min: 20, max: 9000 }),
});
const random = () => 0.3;

describe.each(['websocket', 'events'] as const)('what the page claims by %s', (carrier) => {
  const world = (faults: Fault[]) => new World(faults, carrier, random);

  it('is LIVE of a robot that moves, HOLDING of one that has stood for 3 s', () => {
    const { lies, words } = world([{ what: 'robot stands', atMs: 8000, forMs: 5000 }]).run(20_000);
    expect(lies).toEqual([]);
    expect(words.slice(-3)).toEqual(['LIVE', 'HOLDING', 'LIVE']);
  });

  it.each(FAULTS)('is so, and is claimed again, after: %s', (what) => {
    for (const forMs of [300, 1400, 1700, 2600, 4000, 8000]) {
      const { lies, words } = world([{ what, atMs: SETTLED_MS + 1234, forMs }]).settle(QUIET_MS);
      expect(lies, `${forMs} ms`).toEqual([]);
      expect(words.at(-1), `${forMs} ms`).toBe('LIVE');
    }
  });

  it('is so whatever breaks when', () => {
    fc.assert(
      fc.property(fc.array(fault, { minLength: 1, maxLength: 4 }), (faults) => {
        const { lies, words } = world(faults).settle(QUIET_MS);
        expect(lies).toEqual([]);
        expect(words.at(-1)).toBe('LIVE');
      }),
      // the same faults in every run but the long one, which looks for others
      process.env.POSECAST_FULL === '1' ? { numRuns: 1000 } : { numRuns: 100, seed: 1 },
    );
  });
});
