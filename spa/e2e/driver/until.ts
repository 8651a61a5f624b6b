/** Polling until a condition holds. The page's CSP forbids what the browsers' own wait functions need (eval). */

const INTERVAL_MS = 50;

/** Thrown by a probe that sees that waiting is pointless. */
export class Hopeless extends Error {}

/**
 * Asks `probe` until it returns something other than false, null or undefined, and returns that. `what` names the condition in
 * the error; the last failure is added to it. The deadline is far beyond what a busy machine needs: tests check states and
 * their order, not the time that they take.
 */
export async function until<T>(
  what: string,
  probe: () => T | Promise<T>,
  deadlineMs = 100_000,
): Promise<Exclude<T, false | null | undefined>> {
  const end = performance.now() + deadlineMs;
  let last: unknown;
  for (;;) {
    try {
      const answer = await probe();
      if (answer !== false && answer !== null && answer !== undefined) {
        return answer as Exclude<T, false | null | undefined>;
      }
      last = answer;
    } catch (error) {
      if (error instanceof Hopeless) throw error;
      last = error;
    }
    if (performance.now() > end) {
      throw new Error(`not within ${deadlineMs} ms: ${what}; the last answer was ${String(last)}`);
    }
    await new Promise((resolve) => setTimeout(resolve, INTERVAL_MS));
  }
}
