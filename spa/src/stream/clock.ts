/**
 * Milliseconds of one clock that page and worker share and that never steps back. `performance.now()` alone starts
 * at another instant in each of them.
 */
export function nowMs(): number {
  return performance.timeOrigin + performance.now();
}
