/**
 * Judges whether the page shows a live robot, in one word. Pure: evidence and the clock come in, a verdict goes out.
 *
 * An arriving frame alone proves nothing: a viewer who joins a dead robot is sent its last pose. So freshness comes
 * from the relay's `status`, and from frames that are newer than the newest frame named in that status.
 */

/** PAST: what is shown is from then, and nothing is said of now. RECORDED: likewise, and from files, which have no now. */
export type Word = 'LIVE' | 'HOLDING' | 'STALE' | 'OFFLINE' | 'PAST' | 'RECORDED';
export type Cause = 'robot silent' | 'no connection' | 'relay degraded' | 'waiting for the next part';

export const STALE_AFTER_MS = 1500;
/** The limit while no poses are asked for: the relay then speaks once a second, and the network may delay that by
 *  almost another. */
export const QUIET_AFTER_MS = 2000;
/** A page that has just opened waits this long for the relay before it calls the connection lost. */
export const JOINING_MS = 3000;
/** A live pose that has not changed for this long is called HOLDING. */
export const HOLDING_AFTER_MS = 3000;

/** What the relay says about a robot, about once a second. */
export interface Status {
  robot: 'online' | 'silent' | 'offline';
  /** Age of the newest frame when the relay wrote this; null when it has none. */
  ageMs: number | null;
  seq: number | null;
  /** The relay cannot vouch for what it serves (a gateway without its store). */
  degraded: boolean;
  /** The robot sends more than its share of the relay, so some of its frames are dropped. */
  overShare: boolean;
  /** When it arrived, viewer's clock. */
  atMs: number;
  /** In a stream that comes in parts: when all that is here has been shown, viewer's clock. */
  endsMs?: number;
}

/** All that a verdict is based on. Times are milliseconds of the viewer's own clock, which never steps back. */
export interface Evidence {
  /** When this page began to try. */
  openedMs: number;
  connected: boolean;
  /** When the connection was lost, or null while it stands or before the first one. */
  lostMs: number | null;
  /** Arrival of the newest message of any kind. */
  heardMs: number | null;
  status: Status | null;
  /** Arrival of the newest frame that was newer than the status before it. */
  freshMs: number | null;
  /** When pos, ref or flags last differed from the frame before; null while that is not known. */
  changedMs: number | null;
  /** Since when poses are asked for on this connection; null while the page is hidden and asks for none. */
  watchingMs: number | null;
  /** When the pose that the picture shows was the robot's newest; null while no such pose has come since then. */
  shownMs: number | null;
  /** When the page last stopped calling the shown pose live, on this connection. The stream is told as well, so that
   *  nothing that was under way then counts as newer. */
  otherwiseMs: number | null;
}

/** A recording, unix ms, and how it tells its moments. */
export interface Recorded {
  readonly fromMs: number;
  readonly toMs: number;
  /** "12 Nov 2026 14:02:07". */
  when(momentMs: number): string;
  /** "3:05 of 25:00". */
  within(momentMs: number): string;
  /** The line over the body. `words`: of `when` and more. */
  note(words: string): string;
  /** What is said of a moment whose part is missing or damaged; null of others, as far as that is known. */
  gap(momentMs: number): string | null;
  /** Says that it has not the moment that a link names. */
  lacks(askedMs: number, momentMs: number): string;
}

/** What is shown in PAST and RECORDED. */
interface PastMoment {
  /** Unix ms by the relay's clock. */
  readonly momentMs: number;
  /** The moment that a link asked for, if this one is shown because that one is not kept. */
  readonly askedMs: number | null;
  /** What the robot was then, unless its poses were new. */
  readonly was: 'STALE' | 'OFFLINE' | null;
  /** Whether the shown pose is of that moment, or of the same few seconds; else it is still to come. */
  readonly isHere: boolean;
  /** The recording; null in PAST. */
  readonly recorded: Recorded | null;
  /** Says what is shown. It comes with what plays the past, which few viewers load. `nowMs`: Unix ms by the page's clock. */
  readonly words: (verdict: Pick<Verdict, 'past' | 'ageMs'>, nowMs: number) => PastWords;
}

/** A moment of the past in words. */
export interface PastWords {
  /** "14:02:07"; of a recording "12 Nov 2026 14:02:07". */
  readonly clock: string;
  /** How long ago that was, and what the robot was then if it was not live: " · 2 min ago · was STALE"; of a recording how far
   *  into it: " · 3:05 of 25:00". */
  readonly ago: string;
  /** The line over the body. */
  readonly note: string;
}

export interface Verdict {
  /** null only in the first moments, before anything can be known: on opening, and until a pose has come. */
  word: Word | null;
  cause: Cause | null;
  /** The robot sends too much, and the relay that says so is heard. */
  overShare: boolean;
  /** Age of the newest pose; null when none is known. */
  ageMs: number | null;
  /** Time since the relay was last heard; null when it never was. */
  linkMs: number | null;
  /** How long the pose has not changed; null when that is not known. */
  unchangedMs: number | null;
  /** null unless the word is PAST or RECORDED. */
  past: PastMoment | null;
}

/** The age of the robot's newest pose by status or frames, whichever says less; null when neither is known. */
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

/** Whether the word claims that the shown pose is the robot's present one. */
export function isClaim(word: Word | null): word is 'LIVE' | 'HOLDING' {
  return word === 'LIVE' || word === 'HOLDING';
}

/** Whether the word says that the shown pose is one of then. */
export function isThen(word: Word | null): word is 'PAST' | 'RECORDED' {
  return word === 'PAST' || word === 'RECORDED';
}

/** Whether the shown pose was no longer the robot's own at the time that is shown. */
export function isOld({ word, past }: Pick<Verdict, 'word' | 'past'>): boolean {
  return isThen(word) ? past === null || past.was !== null || !past.isHere : !isClaim(word);
}

/** Whether the relay is heard, so that what its status says about the robot holds now. */
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

  if (!evidence.connected || status === null || linkMs === null || linkMs >= QUIET_AFTER_MS) {
    const joining = evidence.lostMs === null && nowMs - evidence.openedMs <= JOINING_MS;
    if (joining && status === null) return verdict(null);
    return verdict('STALE', 'no connection');
  }
  if (status.degraded) return verdict('STALE', 'relay degraded'); // the relay can't know whether the robot is there
  if (status.robot === 'offline') return verdict('OFFLINE');
  const spokeSince = evidence.freshMs !== null && evidence.freshMs > status.atMs;
  if (status.robot === 'silent' && !spokeSince) return verdict('STALE', 'robot silent');
  const { watchingMs } = evidence;
  const shownMs = pictureMs(evidence);
  const staleMs = watchingMs === null ? QUIET_AFTER_MS : STALE_AFTER_MS; // without poses, only status tells
  if (linkMs >= staleMs) return verdict('STALE', 'no connection');
  if (ageMs === null || ageMs >= staleMs) {
    const isOver = status.endsMs !== undefined && nowMs >= status.endsMs;
    return verdict('STALE', isOver ? 'waiting for the next part' : 'robot silent');
  }
  // The robot is fine, but the shown pose may still be an old one.
  if (watchingMs !== null) {
    if (nowMs - (shownMs ?? watchingMs) >= STALE_AFTER_MS)
      // of a lane the worker has what it says of the robot: the page is slow to show it
      return verdict(
        'STALE',
        status.endsMs ? null : 'relay degraded',
        nowMs - (evidence.shownMs ?? watchingMs),
      );
  }
  if (watchingMs !== null && shownMs === null) return verdict(null); // the first pose is on its way
  if (unchangedMs !== null && unchangedMs >= HOLDING_AFTER_MS) return verdict('HOLDING');
  return verdict('LIVE');
}
