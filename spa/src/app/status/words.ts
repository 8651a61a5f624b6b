import type { Link } from '../../stream/client.ts';
import type { Ending } from '../../stream/messages.ts';
import { formatClock, formatSpan } from '../../twin/format.ts';
import type { Cause, Verdict } from '../../twin/liveness.ts';
import { isolated } from '../../twin/names.ts';
import type { Text } from '../text/en.ts';
import { say } from '../text/language.ts';

/** Every sentence that depends on the state of things: what happened, what the page does about it, what you can do. */

/** How the chip says it: the word, and what stands beside it. */
export interface ChipWords {
  word: string;
  detail: string;
  /** What a narrow screen leaves out. */
  more: string;
  /** What is wrong though the word may be LIVE: every screen shows it. */
  warning: string;
}

export function chipWords(verdict: Verdict, link: Link, nowMs: number): ChipWords {
  return { ...stateWords(verdict, link, nowMs), warning: warningWords(verdict) };
}

/** Beside any word of the chip, and told to those who listen. */
export function warningWords({ overShare }: Pick<Verdict, 'overShare'>): string {
  return overShare ? say().overShare : '';
}

function stateWords(verdict: Verdict, link: Link, nowMs: number): Omit<ChipWords, 'warning'> {
  const { ageMs, unchangedMs } = verdict;
  switch (verdict.word) {
    case null:
      return { word: say().connecting, detail: '', more: '' };
    case 'LIVE':
      return { word: 'LIVE', detail: paceWords(link), more: delayWords(link) };
    case 'HOLDING':
      return { word: 'HOLDING', detail: formatSpan(unchangedMs ?? 0), more: '' };
    case 'STALE': {
      const cause = causeWords(verdict.cause);
      if (ageMs === null) return { word: 'STALE', detail: '', more: cause };
      return { word: 'STALE', detail: formatSpan(ageMs), more: `: ${cause}` };
    }
    case 'OFFLINE':
      return {
        word: 'OFFLINE',
        detail: ageMs === null ? '' : say().since(formatClock(nowMs - ageMs)),
        more: '',
      };
  }
}

function paceWords(link: Link): string {
  return link.hz >= 0.5 ? `${Math.round(link.hz)} Hz` : '';
}

/** How old the newest pose is for us: half a round trip on the way from the relay, and the wait between two frames. */
export function delayMs(link: Link): number | null {
  if (link.roundTripMs === null || link.hz <= 0) return null;
  return link.roundTripMs / 2 + 500 / link.hz;
}

function delayWords(link: Link): string {
  const delay = delayMs(link);
  if (link.by === 'events') return ` · ${say().overHttp}`;
  if (link.by === 'mirror') return ` · ${say().mirror}`;
  return delay === null ? '' : ` · ${formatSpan(delay)}`;
}

export function causeWords(cause: Cause | null): string {
  switch (cause) {
    case null:
      return '';
    case 'robot silent':
      return say().robotSilent;
    case 'no connection':
      return say().noConnection;
    case 'relay degraded':
      return say().relayDegraded;
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

/** The line over the body when the picture is not live; null when it is. */
export function stageWords(verdict: Verdict, link: Link, nowMs: number): string | null {
  if (verdict.word === 'OFFLINE') {
    if (verdict.ageMs === null) return say().notOnAir;
    return say().offlineSince(formatClock(nowMs - verdict.ageMs));
  }
  if (verdict.word !== 'STALE') return null;
  if (verdict.cause === 'no connection') return connectionWords(link, nowMs);
  const since = verdict.ageMs === null ? say().noPoseYet : say().staleFor(formatSpan(verdict.ageMs));
  return `${since}: ${causeWords(verdict.cause)}.`;
}

function connectionWords(link: Link, nowMs: number): string {
  const what = endingWords(link.ending);
  if (link.phase === 'ended') return what;
  if (link.phase !== 'waiting' || link.retryAtMs === null) return say().tryingAgain(what);
  const inS = Math.max(1, Math.ceil((link.retryAtMs - nowMs) / 1000));
  return say().tryingAgainIn(what, inS);
}

export function endingWords(ending: Ending | null): string {
  return say()[ENDING_WORDS[ending?.code ?? 0] ?? 'endedLost'];
}

/** What keeps the stream from being understood. */
export function problemWords({ what, detail }: NonNullable<Link['problem']>): string {
  if (what === 'newer') return say().problemNewer;
  return what === 'schema' ? say().problemSchema(isolated(detail)) : say().problemWorker(isolated(detail));
}

/** What the page is waiting for, once waiting has become noticeable; empty while it gets the body ready itself. */
export function waitingWords(known: { phase: Link['phase']; schema: boolean; pose: boolean }): string {
  if (known.phase !== 'open') return say().waitingRelay;
  if (!known.schema) return say().waitingSchema;
  return known.pose ? '' : say().waitingPose;
}

export function bytesWords(received: number, total: number): string {
  const mega = (bytes: number) => (bytes / 1e6).toFixed(1);
  return total > 0 ? say().bytes(mega(received), mega(total)) : `${mega(received)} MB`;
}
