/** If the wall clock (`Date.now()`) gains this much on ours between two checks, the device slept. */
const SLEPT_MS = 2000;

let sleptMs = 0;
let wallAheadMs = Date.now() - nowMs();

/**
 * Milliseconds of one clock that page and worker share and that never steps back. `performance.now()` alone starts at a different
 * instant in each of them, and in many browsers it stands still while the device sleeps.
 */
export function nowMs(): number {
  return performance.timeOrigin + performance.now() + sleptMs;
}

/** Adds the time that the device slept since the last call; returns the total in ms. Only the page counts, and it
 *  passes the total to the worker (`setSlept`), so that both clocks agree. */
export function countSleep(): number {
  const aheadMs = Date.now() - nowMs() - wallAheadMs;
  if (aheadMs > SLEPT_MS) sleptMs += aheadMs;
  else wallAheadMs += aheadMs;
  return sleptMs;
}

/** Sets the total sleep, as counted by the page, in the worker's clock. */
export function setSlept(ms: number): void {
  sleptMs = ms;
}
