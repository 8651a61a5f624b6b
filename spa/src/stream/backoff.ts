import type { Retry } from '@posecast/wire';

const FIRST_CEILING_MS = 500;
const LAST_CEILING_MS = 30_000;
const SPREAD_S = 10;
const WAIT_S = 30;

/**
 * How long to wait before the next try; null: not by itself. Always with full jitter, anywhere between nothing and a
 * ceiling that doubles: a hall that lost its relay together must not come back together.
 *
 * @param failures tries that failed before this one since the stream last worked
 * @param random in [0, 1)
 * @param retryS what the relay asked for in its `bye`
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
  }
}
