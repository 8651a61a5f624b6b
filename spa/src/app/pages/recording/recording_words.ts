import { PastError } from '../../../past/past_source.ts';
import type { Span } from '../../../past/past_types.ts';
import { IndexError } from '../../../past/recording/recording_index.ts';
import type { LostParts } from '../../../past/recording/recording_past.ts';
import { formatClockSeconds } from '../../../twin/format.ts';
import type { Recorded } from '../../../twin/liveness.ts';
import { isolated } from '../../../twin/names.ts';
import { recordingText } from '../../text/late.ts';
import { dayWords } from '../../words/moment.ts';

/** Why a recording can't be opened, in one sentence. */
export function unreadableWords(error: Error): string {
  const text = recordingText();
  if (error instanceof IndexError)
    return error.why === 'newer' ? text.newer : text.indexDamaged(isolated(error.what));
  if (!(error instanceof PastError)) return isolated(error.message);
  if (error.why === 'away') return text.hostAway;
  return error.why === 'gone' ? text.noIndex : text.indexDamaged(isolated(error.message));
}

/** Which parts of a recording can't be played, in one line; null if none is known to be missing. `parts`: how many parts it
 *  has. */
export function lostWords({ count, isNewer }: LostParts, parts: number): string | null {
  if (count === 0) return null;
  const text = recordingText();
  return isNewer ? `${text.lost(count, parts)} ${text.someNewer}` : text.lost(count, parts);
}

/** A moment of a recording, always with its full date: "12 Nov 2026 14:02:07". */
export function recordedWords(momentMs: number): string {
  return dayWords(momentMs, 0); // a time in 1970 is never the current year, so the year is shown
}

/** A duration in the format of media players: "3:05", "1:00:09". */
export function lengthWords(ms: number): string {
  const all = Math.max(0, Math.floor(ms / 1000));
  const [hours, minutes, seconds] = [Math.floor(all / 3600), Math.floor(all / 60) % 60, all % 60];
  const two = (count: number) => String(count).padStart(2, '0');
  return hours > 0 ? `${hours}:${two(minutes)}:${two(seconds)}` : `${minutes}:${two(seconds)}`;
}

/** How a recording describes its moments. `isLostAt`: whether the part at a moment is known to be unplayable. */
export function recordedAs({ fromMs, toMs }: Span, isLostAt: (momentMs: number) => boolean): Recorded {
  return {
    fromMs,
    toMs,
    when: recordedWords,
    within: (momentMs) => recordingText().within(lengthWords(momentMs - fromMs), lengthWords(toMs - fromMs)),
    note: (words) => recordingText().note(words),
    gap: (momentMs) => (isLostAt(momentMs) ? recordingText().gap : null),
    lacks: (askedMs, momentMs) => recordingText().lacks(recordedWords(askedMs), formatClockSeconds(momentMs)),
  };
}
