import { signInNeeded } from '../../relay/request.ts';
import type { Link } from '../../stream/client.ts';
import type { Ending } from '../../stream/messages.ts';
import { formatClock, formatSpan } from '../../twin/format.ts';
import { type Cause, isThen, type Verdict, type Word } from '../../twin/liveness.ts';
import { isolated } from '../../twin/names.ts';
import type { Text } from '../text/en.ts';
import { say } from '../text/language.ts';
import { spanWords } from './moment.ts';

/** Sentences about the state of the robot, the connection and loading. */

/** The texts of the state chip; each is empty if there is nothing to say. */
export interface ChipWords {
  /** LIVE, HOLDING, STALE, OFFLINE, PAST or RECORDED, or that the page is connecting. */
  word: string;
  /** The frame rate, or how long the state has lasted. */
  detail: string;
  /** Further detail, hidden on narrow screens. */
  more: string;
  /** The delay of everything shown, the state word included: "4 s behind". It is shown on every screen, because without it the
   *  state word would be misleading. */
  behind: string;
  /** A problem that can occur in any state, even LIVE. It is shown on every screen. */
  warning: string;
}

/** The texts of the state chip. `nowMs`: Unix ms by the page's clock. */
export function chipWords(verdict: Verdict, link: Link, nowMs: number): ChipWords {
  return {
    ...stateWords(verdict, link, nowMs),
    behind: behindWords(link.behindMs, verdict.word),
    warning: warningWords(verdict),
  };
}

/** The warning that the robot exceeds its share of the relay; empty if it does not. */
export function warningWords({ overShare }: Pick<Verdict, 'overShare'>): string {
  return overShare ? say().overShare : '';
}

/** "4 s behind", shown beside the state word; empty if there is no delay. */
export function behindWords(behindMs: Link['behindMs'], word: Word | null): string {
  if (behindMs === null || !word || isThen(word)) return '';
  return say().behind(behindSpan(behindMs));
}

/** The delay in whole seconds: tenths vary between the parts of a lane and tell the viewer nothing. */
export function behindSpan(behindMs: number): string {
  return spanWords(Math.max(1000, behindMs));
}

function stateWords(verdict: Verdict, link: Link, nowMs: number): Omit<ChipWords, 'behind' | 'warning'> {
  const { ageMs, unchangedMs } = verdict;
  switch (verdict.word) {
    case null:
      return { word: say().connecting, detail: '', more: '' };
    case 'LIVE':
      return { word: 'LIVE', detail: paceWords(link), more: delayWords(link) };
    case 'HOLDING':
      return { word: 'HOLDING', detail: formatSpan(unchangedMs ?? 0), more: '' };
    case 'STALE': {
      const cause = causeWords(verdict.cause, link);
      // Nothing that could be old was ever shown, so only the reason is given.
      if (ageMs === null && verdict.cause === 'no connection' && link.ending !== null)
        return { word: cause, detail: '', more: '' };
      if (ageMs === null) return { word: 'STALE', detail: '', more: cause };
      return { word: 'STALE', detail: formatSpan(ageMs), more: cause && `: ${cause}` };
    }
    case 'OFFLINE':
      return {
        word: 'OFFLINE',
        detail: ageMs === null ? '' : say().since(formatClock(nowMs - ageMs)),
        more: '',
      };
    case 'PAST':
    case 'RECORDED': {
      const { clock = '', ago = '' } = verdict.past?.words(verdict, nowMs) ?? {};
      return { word: verdict.word, detail: clock, more: ago };
    }
  }
}

function paceWords(link: Link): string {
  return link.hz >= 0.5 ? `${Math.round(link.hz)} Hz` : '';
}

/** The age of the shown pose, ms: the most that it may have taken from the relay, plus half the time between two frames.
 *  null while either is unknown. */
function delayMs({ lateMs, hz }: Pick<Link, 'lateMs' | 'hz'>): number | null {
  return lateMs === null || hz <= 0 ? null : lateMs + 500 / hz;
}

function delayWords(link: Link): string {
  const delay = delayMs(link);
  const age = delay === null || link.behindMs !== null ? '' : ` · ${formatSpan(delay)}`;
  if (link.by === 'events') return `${age} · ${say().overHttp}`;
  return link.by === 'mirror' ? ` · ${say().mirror}` : age;
}

/** Why there is no connection, in a word or two, by close code; other codes get only `noConnection`. */
const SHORT_ENDINGS: Readonly<Record<number, `short${string}` & keyof Text>> = {
  1001: 'shortRestarting',
  1012: 'shortRestarting',
  1013: 'shortFull',
  4401: 'shortToken',
  4403: 'shortForbidden',
  4404: 'shortAbsent',
};

/** Why a robot is STALE; empty for null. With `link`, also why the connection is down. */
export function causeWords(cause: Cause | null, link?: Pick<Link, 'ending'>): string {
  switch (cause) {
    case null:
      return '';
    case 'robot silent':
      return say().robotSilent;
    case 'no connection':
      if (signInNeeded.get()) return say().shortSignIn;
      return say()[SHORT_ENDINGS[link?.ending?.code ?? 0] ?? 'noConnection'];
    case 'slow network':
      return say().slowNetwork;
    case 'busy browser':
      return say().busyBrowser;
    case 'relay degraded':
      return say().relayDegraded;
    case 'waiting for the next part':
      return say().nextPart;
  }
}

/** The sentence for each close code. */
const ENDING_WORDS: Readonly<Record<number, `ended${string}` & keyof Text>> = {
  1001: 'endedRestarting',
  1003: 'endedUnlike',
  1007: 'endedUnlike',
  1008: 'endedUnlike',
  1009: 'endedUnlike',
  1011: 'endedFailed',
  1012: 'endedRestarting',
  1013: 'endedFull',
  4401: 'endedToken',
  4403: 'endedForbidden',
  4404: 'endedAbsent',
  4429: 'endedTooMany',
};

/** The line over the body when its pose is not current: why, and since when; null unless STALE, OFFLINE, PAST or RECORDED.
 *  `nowMs`: Unix ms by the page's clock. */
export function stageWords(verdict: Verdict, link: Link, nowMs: number): string | null {
  if (verdict.word === 'OFFLINE') {
    if (verdict.ageMs === null) return say().notOnAir;
    return say().offlineSince(formatClock(nowMs - verdict.ageMs));
  }
  if (isThen(verdict.word)) return verdict.past?.words(verdict, nowMs).note ?? null;
  if (verdict.word !== 'STALE') return null;
  if (verdict.cause === 'no connection') return connectionWords(link, nowMs);
  const since = verdict.ageMs === null ? say().noPoseYet : say().staleFor(formatSpan(verdict.ageMs));
  const why = causeWords(verdict.cause);
  return `${since}${why && `: ${why}`}.`;
}

function connectionWords(link: Link, nowMs: number): string {
  const what = endingWords(link.ending);
  if (link.phase === 'ended' || signInNeeded.get()) return what;
  if (link.phase !== 'waiting' || link.retryAtMs === null) return say().tryingAgain(what);
  const inS = Math.max(1, Math.ceil((link.retryAtMs - nowMs) / 1000));
  return say().tryingAgainIn(what, inS);
}

/** Why the connection ended, by its close code; a general sentence for unknown codes and null. */
export function endingWords(ending: Ending | null): string {
  if (signInNeeded.get()) return say().endedSignIn;
  return say()[ENDING_WORDS[ending?.code ?? 0] ?? 'endedLost'];
}

/** Why the page can't read the stream, and what to do. */
export function problemWords({ what, detail }: NonNullable<Link['problem']>): string {
  if (what === 'newer') return say().problemNewer;
  return what === 'schema' ? say().problemSchema(isolated(detail)) : say().problemWorker(isolated(detail));
}

/** What the page is waiting for before it can show a body: relay, schema or pose; empty if it has all of them. */
export function waitingWords(known: { phase: Link['phase']; schema: boolean; pose: boolean }): string {
  if (known.phase !== 'open') return say().waitingRelay;
  if (!known.schema) return say().waitingSchema;
  return known.pose ? '' : say().waitingPose;
}

/** Received bytes in MB: "1.2 of 3.4 MB", or "1.2 MB" if `total` is 0. */
export function bytesWords(received: number, total: number): string {
  const mega = (bytes: number) => (bytes / 1e6).toFixed(1);
  return total > 0 ? say().bytes(mega(received), mega(total)) : `${mega(received)} MB`;
}
