import type { Link } from '../stream/client.ts';
import type { Ending } from '../stream/messages.ts';
import { formatClock, formatSpan } from '../twin/format.ts';
import type { Verdict } from '../twin/liveness.ts';

/** Every sentence that depends on the state of things: what happened, what the page does about it, what you can do. */

/** How the chip says it: the word, and what stands beside it. */
export interface ChipWords {
  word: string;
  detail: string;
  /** What a narrow screen leaves out. */
  more: string;
}

export function chipWords(verdict: Verdict, link: Link, nowMs: number): ChipWords {
  const { ageMs, unchangedMs } = verdict;
  switch (verdict.word) {
    case null:
      return { word: 'Connecting', detail: '', more: '' };
    case 'LIVE':
      return { word: 'LIVE', detail: paceWords(link), more: delayWords(link) };
    case 'HOLDING':
      return { word: 'HOLDING', detail: formatSpan(unchangedMs ?? 0), more: '' };
    case 'STALE': {
      const cause = verdict.cause ?? '';
      if (ageMs === null) return { word: 'STALE', detail: '', more: cause };
      return { word: 'STALE', detail: formatSpan(ageMs), more: `: ${cause}` };
    }
    case 'OFFLINE':
      return {
        word: 'OFFLINE',
        detail: ageMs === null ? '' : `since ${formatClock(nowMs - ageMs)}`,
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
  return delay === null ? '' : ` · ${formatSpan(delay)}`;
}

/** The explanation behind the chip. */
export function truthWords(verdict: Verdict, link: Link): string[] {
  const lines: string[] = [];
  const heard = verdict.linkMs === null ? 'not heard yet' : `last heard ${formatSpan(verdict.linkMs)} ago`;
  switch (verdict.word) {
    case null:
      lines.push('Connecting to the relay.');
      break;
    case 'LIVE':
      lines.push('New poses are coming in.');
      break;
    case 'HOLDING':
      lines.push(
        `The robot holds still: position, reference and flags have not changed for ${formatSpan(verdict.unchangedMs ?? 0)}. The link is fine.`,
      );
      break;
    case 'STALE':
      if (verdict.cause === 'robot silent') {
        lines.push('The relay is there, but the robot sends nothing new. What you see is its last pose.');
      } else if (verdict.cause === 'relay degraded') {
        lines.push('The relay is there, but it cannot pass on what the robot does now.');
      } else {
        lines.push('This page has lost the relay. What you see is the last pose that came through.');
      }
      break;
    case 'OFFLINE':
      lines.push('The robot has left the air. The page goes on by itself when it comes back.');
      break;
  }
  lines.push(`Relay: ${heard}.`);
  if (link.roundTripMs !== null) lines.push(`Round trip to the relay: ${formatSpan(link.roundTripMs)}.`);
  if (link.rateReason !== null && link.grantedHz !== null) {
    lines.push(`${Math.round(link.grantedHz)} Hz: ${link.rateReason}.`);
  }
  return lines;
}

/** The line over the body when the picture is not live; null when it is. */
export function stageWords(verdict: Verdict, link: Link, nowMs: number): string | null {
  if (verdict.word === 'OFFLINE') {
    if (verdict.ageMs === null) return 'This robot is not on air. The page goes on by itself when it comes.';
    return `Offline since ${formatClock(nowMs - verdict.ageMs)}. The page goes on by itself when the robot is back.`;
  }
  if (verdict.word !== 'STALE') return null;
  if (verdict.cause === 'no connection') return connectionWords(link, nowMs);
  const since = verdict.ageMs === null ? 'No pose yet' : `Stale for ${formatSpan(verdict.ageMs)}`;
  return `${since}: ${verdict.cause ?? ''}.`;
}

function connectionWords(link: Link, nowMs: number): string {
  const what = endingWords(link.ending);
  if (link.phase === 'ended') return what;
  if (link.phase !== 'waiting' || link.retryAtMs === null) return `${what} Trying again.`;
  const inS = Math.max(1, Math.ceil((link.retryAtMs - nowMs) / 1000));
  return `${what} Trying again in ${inS} s.`;
}

export function endingWords(ending: Ending | null): string {
  switch (ending?.code) {
    case 1001:
    case 1012:
      return 'The relay is restarting.';
    case 1013:
      return 'The hall is full.';
    case 4401:
      return 'This robot needs a sign-in or a share link.';
    case 4403:
      return 'This robot is not shared with you.';
    case 4404:
      return 'There is no robot of this name here.';
    case 4429:
      return 'The relay asked this page to slow down.';
    default:
      return 'No connection.';
  }
}

/** What the page is waiting for, once waiting has become noticeable. */
export function waitingWords(known: { phase: Link['phase']; schema: boolean; pose: boolean }): string {
  if (known.phase !== 'open') return 'Waiting for the relay to answer.';
  if (!known.schema) return 'Waiting for the robot to describe itself.';
  if (!known.pose) return 'Waiting for the first pose.';
  return 'Waiting for the body. The robot has not sent its model.';
}

export function missingWords(missing: readonly string[], all: number | null): string {
  const names = missing.map((uri) => (uri.split('/').at(-1) ?? uri).replace(/\.[a-z]+$/i, ''));
  const shown = names.slice(0, 4).join(', ') + (names.length > 4 ? ', …' : '');
  const one = missing.length === 1;
  if (all === null) return `${missing.length} ${one ? 'mesh is' : 'meshes are'} missing: ${shown}.`;
  return `${missing.length} of ${all} meshes ${one ? 'is' : 'are'} missing: ${shown}.`;
}

/** Under a body of which only the bones could be had. */
export function bareWords(why: string): string {
  return `Only the skeleton can be shown: ${why}.`;
}

export function bytesWords(received: number, total: number): string {
  const mega = (bytes: number) => (bytes / 1e6).toFixed(1);
  return total > 0 ? `${mega(received)} of ${mega(total)} MB` : `${mega(received)} MB`;
}
