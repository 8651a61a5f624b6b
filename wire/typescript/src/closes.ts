/** How a stream may end: every close code, and what the viewer does next (also in `wire/closes.json`). */

export const Close = {
  GOING_AWAY: 1001,
  BINARY: 1003,
  NOT_UTF8: 1007,
  NOT_ALLOWED: 1008,
  TOO_LONG: 1009,
  DRAIN: 1012,
  FULL: 1013,
  AGE_LIMIT: 4000,
  TOKEN: 4401,
  FORBIDDEN: 4403,
  ABSENT: 4404,
  HALF_OPEN: 4408,
  NO_ACK: 4409,
  TOO_MANY: 4429,
  EVENTS_FULL: 4430,
} as const;

/**
 * What a viewer does after an ending.
 * `backoff`: full jitter, random(0 … min(30 s, 0.5 s × 2^attempt)).
 * `spread`: first after random(0 … retry_s of `bye`, 10 s when it told none), then backoff.
 * `wait`: not before retry_s of `bye` (30 s when it told none), then backoff.
 * `never`: not by itself: asking again will not help until a person does something.
 */
export type Retry = 'backoff' | 'spread' | 'wait' | 'never';

/** Short name, what happened in words a viewer understands, and what comes next. */
export interface Ending {
  readonly name: string;
  readonly meaning: string;
  readonly retry: Retry;
}

export const ENDINGS: ReadonlyMap<number, Ending> = new Map(
  (
    [
      [1001, 'going away', 'the relay is stopping', 'spread'],
      [1003, 'binary', 'a viewer sent a binary message; viewers send text only', 'never'],
      [1007, 'not UTF-8', 'a viewer sent text that is not UTF-8', 'never'],
      [1008, 'not allowed', 'a viewer sent a message the relay does not know', 'never'],
      [1009, 'too long', 'a viewer sent a message over 4 KiB', 'never'],
      [1012, 'drain', 'the relay is being replaced', 'spread'],
      [1013, 'full', 'the relay has as many viewers as it takes', 'wait'],
      [4000, 'age limit', 'connections are renewed from time to time', 'spread'],
      [4401, 'token', 'the link or sign-in is missing, wrong or expired', 'never'],
      [4403, 'forbidden', 'this robot or view is not for this viewer', 'never'],
      [4404, 'absent', 'there is no such robot here', 'never'],
      [4408, 'half-open', 'the viewer no longer answered', 'backoff'],
      [4409, 'no acknowledgement', 'the viewer no longer acknowledged frames', 'backoff'],
      [4429, 'too many messages', 'the viewer sent messages too fast', 'wait'],
      [4430, 'event lane full', 'the viewer was too slow for the events', 'backoff'],
    ] as const
  ).map(([code, name, meaning, retry]) => [code, { name, meaning, retry }]),
);

/** What to do after a close code; one that is not in the table (1006, a proxy's own) means backoff. */
export function retryOf(code: number): Retry {
  return ENDINGS.get(code)?.retry ?? 'backoff';
}
