/**
 * The truth of the whole page in one word. Pure: evidence and the clock come in, a verdict goes out.
 *
 * A frame that arrives proves nothing by itself: whoever joins a dead robot is given its last pose. So freshness comes
 * from the relay's `status`, and from frames that are newer than what that status already knew.
 */

export type Word = 'LIVE' | 'HOLDING' | 'STALE' | 'OFFLINE';
export type Cause = 'robot silent' | 'no connection' | 'relay degraded';

export const STALE_AFTER_MS = 1500;
/** Where no pose is claimed to be new the relay speaks once a second, and a network may hold that up for most of another. */
export const QUIET_AFTER_MS = 2000;
/** A page that has only just opened claims nothing for this long. */
export const JOINING_MS = 3000;
export const HOLDING_AFTER_MS = 3000;

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
}

/** All times are milliseconds of one clock of the viewer's own that never steps back. */
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
  /** When pos, ref or flags last differed from the frame before; null while nobody can know. */
  changedMs: number | null;
  /** Since when poses are asked for on this connection; null while the page is hidden and asks for none. */
  watchingMs: number | null;
  /** When the pose that the picture shows was the robot's newest; null while no such pose has come since then. */
  shownMs: number | null;
  /** When the page last ceased to call that pose live, on this connection. */
  otherwiseMs: number | null;
}

export interface Verdict {
  /** null only in the first moments, before anything can be known: on opening, and until a pose has come. */
  word: Word | null;
  cause: Cause | null;
  /** The robot sends too much, and the relay that says so is heard. */
  overShare: boolean;
  /** Age of the newest pose; null when none is known. */
  ageMs: number | null;
  /** Since the relay was last heard. */
  linkMs: number | null;
  /** How long the pose has not changed; null when that is not known. */
  unchangedMs: number | null;
}

export function newestAgeMs(evidence: Evidence, nowMs: number): number | null {
  const { status, freshMs } = evidence;
  const byStatus = status === null || status.ageMs === null ? null : status.ageMs + nowMs - status.atMs;
  const byFrame = freshMs === null ? null : nowMs - freshMs;
  if (byStatus === null) return byFrame;
  return byFrame === null ? byStatus : Math.min(byStatus, byFrame);
}

/** When the picture was new. One from before an outage is none after it, however short that was. */
function pictureMs({ shownMs, otherwiseMs }: Evidence): number | null {
  return shownMs !== null && shownMs < (otherwiseMs ?? shownMs) ? null : shownMs;
}

export function isClaim(word: Word | null): word is 'LIVE' | 'HOLDING' {
  return word === 'LIVE' || word === 'HOLDING';
}

/** What the relay says of the robot's sending holds now. */
function isHeard(word: Word | null, cause: Cause | null): boolean {
  return word !== null && word !== 'OFFLINE' && cause !== 'no connection';
}

export function judge(evidence: Evidence, nowMs: number): Verdict {
  const { status } = evidence;
  const ageMs = newestAgeMs(evidence, nowMs);
  const linkMs = evidence.heardMs === null ? null : nowMs - evidence.heardMs;
  const unchangedMs = evidence.changedMs === null ? null : nowMs - evidence.changedMs;
  const verdict = (word: Word | null, cause: Cause | null = null): Verdict => ({
    word,
    cause,
    overShare: status?.overShare === true && isHeard(word, cause),
    ageMs,
    linkMs,
    unchangedMs,
  });

  if (!evidence.connected || status === null || linkMs === null || linkMs >= QUIET_AFTER_MS) {
    const joining = evidence.lostMs === null && nowMs - evidence.openedMs <= JOINING_MS;
    if (joining && status === null) return verdict(null);
    return verdict('STALE', 'no connection');
  }
  if (status.degraded) return verdict('STALE', 'relay degraded'); // it can't know whether the robot is there
  if (status.robot === 'offline') return verdict('OFFLINE');
  const spokeSince = evidence.freshMs !== null && evidence.freshMs > status.atMs;
  if (status.robot === 'silent' && !spokeSince) return verdict('STALE', 'robot silent');
  const { watchingMs } = evidence;
  const shownMs = pictureMs(evidence);
  const staleMs = watchingMs === null ? QUIET_AFTER_MS : STALE_AFTER_MS; // who asks for no poses hears by status alone
  if (linkMs >= staleMs) return verdict('STALE', 'no connection');
  if (ageMs === null || ageMs >= staleMs) return verdict('STALE', 'robot silent');
  // The robot is well, but is it what the picture shows?
  if (watchingMs !== null && nowMs - (shownMs ?? watchingMs) >= STALE_AFTER_MS) {
    return verdict('STALE', 'relay degraded');
  }
  if (watchingMs !== null && shownMs === null) return verdict(null); // the first pose is on its way
  if (unchangedMs !== null && unchangedMs >= HOLDING_AFTER_MS) return verdict('HOLDING');
  return verdict('LIVE');
}
