/** The clock of the wall running ahead of ours by this much means that the device slept. */
const SLEPT_MS = 2000;

let sleptMs = 0;
let wallAheadMs = Date.now() - nowMs();

/**
 * Milliseconds of one clock that page and worker share and that never steps back. `performance.now()` alone starts
 * at another instant in each of them, and in many browsers it stands still while the device sleeps.
 */
export function nowMs(): number {
  return performance.timeOrigin + performance.now() + sleptMs;
}

/** Takes in what the device has slept since the last call; ms in all. The page counts and tells the worker, so that both
 *  have the same. */
export function countSleep(): number {
  const aheadMs = Date.now() - nowMs() - wallAheadMs;
  if (aheadMs > SLEPT_MS) sleptMs += aheadMs;
  else wallAheadMs += aheadMs;
  return sleptMs;
}

/** @param ms what the page has counted */
export function setSlept(ms: number): void {
  sleptMs = ms;
}
