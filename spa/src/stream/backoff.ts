import type { Retry } from '@posecast/wire';

const FIRST_CEILING_MS = 500;
const LAST_CEILING_MS = 30_000;
const SPREAD_S = 10;
/** The wait if a full relay does not specify one. */
export const WAIT_S = 30;
/** The shortest wait for a robot that is absent; the longest is twice that. */
const LATER_MS = 30_000;

/**
 * Milliseconds to wait before the next try; null: don't retry automatically. The wait is random between 0 and a ceiling that
 * doubles with each failure ("full jitter"), so that viewers who lost their relay together don't come back together.
 *
 * `failures` counts failed tries since the stream last worked, `random` is in [0, 1), and `retryS` is the wait in seconds from
 * the relay's `bye`.
 */
export function retryDelayMs(
  rule: Retry,
  failures: number,
  random: number,
  retryS: number | null,
): number | null {
  const backoff = random * Math.min(LAST_CEILING_MS, FIRST_CEILING_MS * 2 ** failures);
  switch (rule) {
    case 'never':
      return null;
    case 'backoff':
      return backoff;
    case 'spread':
      return failures === 0 ? random * (retryS ?? SPREAD_S) * 1000 : backoff;
    case 'wait':
      return (retryS ?? WAIT_S) * 1000 + backoff;
    case 'later':
      return LATER_MS * (1 + random);
  }
}
