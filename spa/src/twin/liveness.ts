import { remember, type Span } from '../kit.ts';

/**
 * Judges whether the page shows a live robot, in one word. Pure: evidence and the clock are passed in, and the result is a
 * verdict. Ages are upper bounds: a delay in transit that cannot be measured counts as age.
 *
 * An arriving frame alone proves nothing: a viewer who joins a dead robot is sent its last pose. So freshness comes from the
 * relay's `status`, and from frames that are newer than the newest frame named in that status.
 */

/** PAST: the picture is from the past and says nothing about the present. RECORDED: the same, from files, which have no
 *  present. */
export type Word = 'LIVE' | 'HOLDING' | 'STALE' | 'OFFLINE' | 'PAST' | 'RECORDED';
export type Cause =
  | 'robot silent'
  | 'no connection'
  | 'slow network'
  | 'busy browser'
  | 'relay degraded'
  | 'waiting for the next part';

export const STALE_AFTER_MS = 1500;
/** Messages this close to each other count as one. */
const TOGETHER_MS = 50;
/** The limit while no poses are requested: the relay then sends once a second, and the network may delay that by almost another
 *  second. */
export const QUIET_AFTER_MS = 2000;
/** A newly opened page waits this long for the relay before it calls the connection lost. */
export const JOINING_MS = 3000;
/** A live pose that has not changed for this long is called HOLDING. */
export const HOLDING_AFTER_MS = 3000;

/** A longer time in which a thread of the page did not run counts as a hold-up: its timers come more often. */
export const HELD_UP_MS = 400;
/** After a still longer one, the device slept. */
const SLEPT_MS = 10_000;
/** How many hold-ups are remembered. */
const HOLD_UPS = 30;

/** When threads of the page did not run, because other tabs or programs, or the page's own work, kept them waiting. A page that
 *  is late itself must not blame the robot, the relay or the network. */
export class HoldUps {
  readonly #spans: Span[] = [];

  /** Records that a thread did not run between these times. */
  record(fromMs: number, toMs: number): void {
    if (toMs - fromMs > HELD_UP_MS && toMs - fromMs < SLEPT_MS)
      remember(this.#spans, { fromMs, toMs }, HOLD_UPS);
  }

  /** Whether some thread did not run in most of the time between these. */
  explain(fromMs: number, toMs: number): boolean {
    let [heldUpMs, countedMs] = [0, fromMs];
    for (const span of [...this.#spans].sort((a, b) => a.fromMs - b.fromMs)) {
      const endMs = Math.min(span.toMs, toMs);
      heldUpMs += Math.max(0, endMs - Math.max(span.fromMs, countedMs));
      countedMs = Math.max(countedMs, endMs);
    }
    return heldUpMs > (toMs - fromMs) / 2;
  }
}

/** The relay's report about a robot, about once a second. */
export interface Status {
  robot: 'online' | 'silent' | 'offline';
  /** Age of the newest frame when the relay wrote this; null if it has none. */
  ageMs: number | null;
  seq: number | null;
  /** The relay cannot vouch for what it serves (a gateway without its store). */
  degraded: boolean;
  /** The robot sends more than its share of the relay, so some of its frames are dropped. */
  overShare: boolean;
  /** When it was written, at the earliest, viewer's clock. */
  atMs: number;
  /** When it was written, at the latest; without it, at `atMs`. */
  heardMs?: number;
  /** Its delay in transit, at most, ms; `atMs` assumes that. */
  transitMs?: number;
  /** In a stream of parts: when everything loaded has been shown, viewer's clock. */
  endsMs?: number;
}

/** The basis of a verdict. Times are milliseconds of the viewer's own clock, which never steps back. */
export interface Evidence {
  /** When this page started to connect. */
  openedMs: number;
  connected: boolean;
  /** When the connection was lost; null while it is up or before the first one. */
  lostMs: number | null;
  /** Arrival of the newest message of any kind. */
  heardMs: number | null;
  status: Status | null;
  /** When the newest frame that was newer than the preceding status was written, at the earliest. */
  freshMs: number | null;
  /** When pos, ref or flags last differed from the previous frame; null while unknown. */
  changedMs: number | null;
  /** Since when poses have been requested on this connection; null while the page is hidden and requests none. */
  watchingMs: number | null;
  /** When the displayed pose was the robot's newest; null if no such pose has arrived since then. */
  shownMs: number | null;
  /** When the page last stopped calling the shown pose live, on this connection. The stream is told too, so that data in transit
   *  at that time does not count as newer. */
  otherwiseMs: number | null;
  /** The delay of the newest frame or status in transit, at most, ms. The times above include it. */
  transitMs: number;
  /** When this page itself was late. */
  readonly holdUps: HoldUps;
}

/** A recording, unix ms, and the formatting of its moments. */
export interface Recorded {
  readonly fromMs: number;
  readonly toMs: number;
  /** "12 Nov 2026 14:02:07". */
  when(momentMs: number): string;
  /** "3:05 of 25:00". */
  within(momentMs: number): string;
  /** The line over the body. `words`: for `when` and more. */
  note(words: string): string;
  /** The text for a moment whose part is missing or damaged; null for others, as far as known. */
  gap(momentMs: number): string | null;
  /** The text saying that the recording does not contain the moment in the link. */
  lacks(askedMs: number, momentMs: number): string;
}

/** What is shown in PAST and RECORDED. */
interface PastMoment {
  /** Unix ms by the relay's clock. */
  readonly momentMs: number;
  /** The moment in the link, if another one is shown because that one is not kept. */
  readonly askedMs: number | null;
  /** The robot's state at that moment, unless its poses were live. */
  readonly was: 'STALE' | 'OFFLINE' | null;
  /** Whether the shown pose is from that moment, or within a few seconds of it; otherwise it is still loading. */
  readonly isHere: boolean;
  /** The recording; null in PAST. */
  readonly recorded: Recorded | null;
  /** Describes what is shown. It is part of the player code, which few viewers load. `nowMs`: Unix ms by the page's clock. */
  readonly words: (verdict: Pick<Verdict, 'past' | 'ageMs'>, nowMs: number) => PastWords;
}

/** A moment of the past in words. */
export interface PastWords {
  /** "14:02:07"; for a recording "12 Nov 2026 14:02:07". */
  readonly clock: string;
  /** How long ago that was, and the robot's state then if it was not live: " · 2 min ago · was STALE"; for a recording, how far
   *  into it: " · 3:05 of 25:00". */
  readonly ago: string;
  /** The line over the body. */
  readonly note: string;
}

export interface Verdict {
  /** null only at the very start, before anything can be known: on opening, and until a pose has arrived. */
  word: Word | null;
  cause: Cause | null;
  /** The robot exceeds its share, and the relay that says so is connected. */
  overShare: boolean;
  /** Age of the newest pose; null if unknown. */
  ageMs: number | null;
  /** Time since the last message from the relay; null if there was none. */
  linkMs: number | null;
  /** How long the pose has been unchanged; null if unknown. */
  unchangedMs: number | null;
  /** null unless the word is PAST or RECORDED. */
  past: PastMoment | null;
}

/** The age of the robot's newest pose from status or frames, whichever is smaller; null if neither is known. */
export function newestAgeMs(evidence: Evidence, nowMs: number): number | null {
  const { status, freshMs } = evidence;
  const byStatus = status === null || status.ageMs === null ? null : status.ageMs + nowMs - status.atMs;
  const byFrame = freshMs === null ? null : nowMs - freshMs;
  if (byStatus === null) return byFrame;
  return byFrame === null ? byStatus : Math.min(byStatus, byFrame);
}

/** When the shown pose was new; null if there is none, or if it is from before an outage, however short. */
function pictureMs({ shownMs, otherwiseMs }: Evidence): number | null {
  return shownMs !== null && otherwiseMs !== null && shownMs <= otherwiseMs ? null : shownMs;
}

/** Whether the word claims that the shown pose is current. */
export function isClaim(word: Word | null): word is 'LIVE' | 'HOLDING' {
  return word === 'LIVE' || word === 'HOLDING';
}

/** Whether the word says that the shown pose is from the past. */
export function isThen(word: Word | null): word is 'PAST' | 'RECORDED' {
  return word === 'PAST' || word === 'RECORDED';
}

/** Whether the shown pose was out of date at the shown time. */
export function isOld({ word, past }: Pick<Verdict, 'word' | 'past'>): boolean {
  return isThen(word) ? past === null || past.was !== null || !past.isHere : !isClaim(word);
}

/** Whether the relay is connected, so that its status about the robot is valid now. */
function isHeard(word: Word | null, cause: Cause | null): boolean {
  return word !== null && word !== 'OFFLINE' && cause !== 'no connection';
}

/** The verdict at `nowMs`. */
export function judge(evidence: Evidence, nowMs: number): Verdict {
  const { status } = evidence;
  const ageMs = newestAgeMs(evidence, nowMs);
  const linkMs = evidence.heardMs === null ? null : nowMs - evidence.heardMs;
  const unchangedMs = evidence.changedMs === null ? null : nowMs - evidence.changedMs;
  const verdict = (word: Word | null, cause: Cause | null = null, shownAgeMs = ageMs): Verdict => ({
    word,
    cause,
    overShare: status?.overShare === true && isHeard(word, cause),
    ageMs: shownAgeMs,
    linkMs,
    unchangedMs,
    past: null,
  });

  const isBusy = (ms: number) => evidence.holdUps.explain(nowMs - ms, nowMs);
  const joining = evidence.lostMs === null && nowMs - evidence.openedMs <= JOINING_MS;
  if (!evidence.connected || status === null || linkMs === null || linkMs >= QUIET_AFTER_MS) {
    if (joining && status === null) return verdict(null);
    const isLate = evidence.connected && linkMs !== null && isBusy(linkMs);
    return verdict('STALE', isLate ? 'busy browser' : 'no connection');
  }
  if (status.degraded) return verdict('STALE', 'relay degraded'); // the relay can't know whether the robot is there
  if (status.robot === 'offline') return verdict('OFFLINE');
  const spokeSince = evidence.freshMs !== null && evidence.freshMs > status.atMs;
  if (status.robot === 'silent' && !spokeSince) return verdict('STALE', 'robot silent');
  const { watchingMs } = evidence;
  const shownMs = pictureMs(evidence);
  const staleMs = watchingMs === null ? QUIET_AFTER_MS : STALE_AFTER_MS; // without poses, only the status tells
  if (linkMs >= staleMs) return verdict('STALE', isBusy(linkMs) ? 'busy browser' : 'no connection');
  /** If most of this age may be delay in transit, that is the cause. A page that opens waits until more is known. */
  const stale = (oldMs: number | null, cause: Cause | null): Verdict => {
    const isSlow = oldMs !== null && evidence.transitMs > oldMs / 2;
    if (isSlow && joining) return verdict(null);
    if (oldMs !== null && isBusy(oldMs)) return verdict('STALE', 'busy browser', oldMs);
    // if nothing at all has arrived since the pose, neither robot nor relay is to blame
    const isCutOff = oldMs !== null && !status.endsMs && linkMs + evidence.transitMs > oldMs - TOGETHER_MS;
    return verdict('STALE', isSlow ? 'slow network' : isCutOff ? 'no connection' : cause, oldMs);
  };
  if (ageMs === null || ageMs >= staleMs) {
    const isOver = status.endsMs !== undefined && nowMs >= status.endsMs;
    return stale(ageMs, isOver ? 'waiting for the next part' : 'robot silent');
  }
  // The robot is fine, but the shown pose may still be an old one.
  if (watchingMs !== null && nowMs - (shownMs ?? watchingMs) >= STALE_AFTER_MS) {
    // in a lane, the worker already knows the robot's state: the page is slow to show it
    return stale(nowMs - (evidence.shownMs ?? watchingMs), status.endsMs ? null : 'relay degraded');
  }
  if (watchingMs !== null && shownMs === null) return verdict(null); // the first pose is in transit
  if (unchangedMs !== null && unchangedMs >= HOLDING_AFTER_MS) return verdict('HOLDING');
  return verdict('LIVE');
}
