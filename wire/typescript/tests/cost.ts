/** What reading costs, measured so that a busy machine changes little: CPU time of this process, the least of some rounds. */

import { expect } from 'vitest';

function costMs(start: NodeJS.CpuUsage): number {
  const { user, system } = process.cpuUsage(start);
  return (user + system) / 1000;
}

function quickestMs(work: () => void): number {
  let best = Number.POSITIVE_INFINITY;
  for (let i = 0; i < 5; i++) {
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

/** The CPU time of the quickest of five runs of asynchronous work. */
async function quickestOfTurnsMs(work: () => Promise<unknown>): Promise<number> {
  let best = Number.POSITIVE_INFINITY;
  for (let i = 0; i < 5; i++) {
    const start = process.cpuUsage();
    await work().catch(() => {});
    best = Math.min(best, costMs(start));
  }
  return best;
}

/** Of inputs n, 4n and 16n, as far as a busy machine can tell: quadratic work would be 256 times as much. */
export function expectNoFasterThanInput<T>(
  make: (n: number) => T,
  read: (input: T) => void,
  n: number,
): void {
  const [small, middle, large] = [make(n), make(4 * n), make(16 * n)];
  const ofSmall = quickestMs(() => read(small));
  expect(quickestMs(() => read(middle))).toBeLessThan(4 * 4 * ofSmall + 3);
  expect(quickestMs(() => read(large))).toBeLessThan(16 * 4 * ofSmall + 12);
}

export async function expectTurnsNoFasterThanInput<T>(
  make: (n: number) => T,
  read: (input: T) => Promise<unknown>,
  n: number,
): Promise<void> {
  const [small, middle, large] = [make(n), make(4 * n), make(16 * n)];
  const ofSmall = await quickestOfTurnsMs(() => read(small));
  expect(await quickestOfTurnsMs(() => read(middle))).toBeLessThan(4 * 4 * ofSmall + 3);
  expect(await quickestOfTurnsMs(() => read(large))).toBeLessThan(16 * 4 * ofSmall + 12);
}
