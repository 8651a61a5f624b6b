/** What reading costs, measured so that a busy machine changes little: CPU time of this process, the least of some rounds. */

import { expect } from 'vitest';

const ROUNDS = 5;

function costMs(start: NodeJS.CpuUsage): number {
  const { user, system } = process.cpuUsage(start);
  return (user + system) / 1000;
}

/** The CPU time of the quickest of some runs, of which no more are made once one took less than `enough`, ms. */
function quickestMs(work: () => void, enough = 0): number {
  let best = Number.POSITIVE_INFINITY;
  for (let i = 0; i < ROUNDS && best >= enough; i++) {
    const start = process.cpuUsage();
    try {
      work();
    } catch {
      // what is refused counts like what is read
    }
    best = Math.min(best, costMs(start));
  }
  return best;
}

/** The same of asynchronous work. */
async function quickestOfTurnsMs(work: () => Promise<unknown>, enough = 0): Promise<number> {
  let best = Number.POSITIVE_INFINITY;
  for (let i = 0; i < ROUNDS && best >= enough; i++) {
    const start = process.cpuUsage();
    await work().catch(() => {});
    best = Math.min(best, costMs(start));
  }
  return best;
}

/** What inputs 4n and 16n may cost, as far as a busy machine can tell: quadratic work would be 256 times as much. */
function boundsMs(ofSmall: number): [middle: number, large: number] {
  return [4 * 4 * ofSmall + 3, 16 * 4 * ofSmall + 12];
}

export function expectNoFasterThanInput<T>(
  make: (n: number) => T,
  read: (input: T) => void,
  n: number,
): void {
  const [small, middle, large] = [make(n), make(4 * n), make(16 * n)];
  const [ofMiddle, ofLarge] = boundsMs(quickestMs(() => read(small)));
  expect(quickestMs(() => read(middle), ofMiddle)).toBeLessThan(ofMiddle);
  expect(quickestMs(() => read(large), ofLarge)).toBeLessThan(ofLarge);
}

export async function expectTurnsNoFasterThanInput<T>(
  make: (n: number) => T,
  read: (input: T) => Promise<unknown>,
  n: number,
): Promise<void> {
  const [small, middle, large] = [make(n), make(4 * n), make(16 * n)];
  const [ofMiddle, ofLarge] = boundsMs(await quickestOfTurnsMs(() => read(small)));
  expect(await quickestOfTurnsMs(() => read(middle), ofMiddle)).toBeLessThan(ofMiddle);
  expect(await quickestOfTurnsMs(() => read(large), ofLarge)).toBeLessThan(ofLarge);
}
