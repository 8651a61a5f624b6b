/** How a stream may end: every close code, and what the viewer does next (also in `wire/closes.json`). */

export const Close = {
  GOING_AWAY: 1001,
  BINARY: 1003,
  NOT_UTF8: 1007,
  NOT_ALLOWED: 1008,
  TOO_LONG: 1009,
  INTERNAL_ERROR: 1011,
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
 * `spread`: first after random(0 … retry_s of `bye`, 10 s if it has none), then backoff.
 * `wait`: not before retry_s of `bye` (30 s if it has none), then backoff.
 * `later`: after random(30 … 60 s), each time: the robot may be added or come back.
 * `never`: not by itself: asking again will not help until a person does something.
 */
export type Retry = 'backoff' | 'spread' | 'wait' | 'later' | 'never';

/** Short name, what happened in words a viewer understands, and what comes next. */
export interface Ending {
  readonly name: string;
  readonly meaning: string;
  readonly retry: Retry;
}

const RETRIES = new Map<number, Retry>([
  [Close.GOING_AWAY, 'spread'],
  [Close.BINARY, 'never'],
  [Close.NOT_UTF8, 'never'],
  [Close.NOT_ALLOWED, 'never'],
  [Close.TOO_LONG, 'never'],
  [Close.DRAIN, 'spread'],
  [Close.FULL, 'wait'],
  [Close.AGE_LIMIT, 'spread'],
  [Close.TOKEN, 'never'],
  [Close.FORBIDDEN, 'never'],
  [Close.ABSENT, 'later'],
  [Close.TOO_MANY, 'wait'],
]);

/** What to do after a close code; one that is not in the table (1006, a proxy's own) means backoff. */
export function retryOf(code: number): Retry {
  return RETRIES.get(code) ?? 'backoff';
}

/** Apart from the rules, which a page cannot do without: bundlers leave the words out where nobody reads them. */
export const ENDINGS: ReadonlyMap<number, Ending> = /* @__PURE__ */ new Map(
  /* @__PURE__ */ (
    [
      [1001, 'going away', 'a proxy on the way is stopping'],
      [1003, 'binary', 'a viewer sent a binary message; viewers send text only'],
      [1007, 'not UTF-8', 'a viewer sent text that is not UTF-8'],
      [1008, 'not allowed', 'a viewer sent a message the relay does not know'],
      [1009, 'too long', 'a viewer sent a message over 4 KiB'],
      [1011, 'internal error', 'the relay had an internal error on this connection'],
      [1012, 'drain', 'the relay is being replaced'],
      [1013, 'full', 'the relay has no room for more viewers'],
      [4000, 'age limit', 'connections are renewed from time to time'],
      [4401, 'token', 'the link or sign-in is missing, wrong or expired'],
      [4403, 'forbidden', 'this viewer may not see this robot or view'],
      [4404, 'absent', 'there is no such robot here'],
      [4408, 'half-open', 'the viewer no longer answered'],
      [4409, 'no acknowledgement', 'the viewer left data unread or acknowledged nothing'],
      [4429, 'too many messages', 'the viewer sent messages too fast'],
      [4430, 'event queue full', 'the viewer was too slow to receive events'],
    ] as const
  ).map(([code, name, meaning]) => [code, { name, meaning, retry: retryOf(code) }]),
);
