import { formatClockSeconds, formatSpan } from '../../../twin/format.ts';
import { languageTag } from '../../text/language.ts';
import { pastText } from '../../text/past.ts';

/** A moment as links name it, UTC: "2026-11-22T14:02:07.250Z". */
export function formatMoment(momentMs: number): string {
  return new Date(Math.round(momentMs)).toISOString();
}

/** A moment in the viewer's time zone and how long ago it was: "14:02:07 · 2 min ago"; with the date if that was not
 *  today. */
export function momentWords(momentMs: number, nowMs: number): string {
  const date = dateWords(momentMs, nowMs);
  const clock = formatClockSeconds(momentMs);
  return `${date === '' ? clock : `${date} ${clock}`} · ${agoWords(momentMs, nowMs)}`;
}

/** "2 min ago"; at least a second. */
export function agoWords(momentMs: number, nowMs: number): string {
  const text = pastText();
  const ms = Math.max(1000, nowMs - momentMs);
  if (ms < 9950) return text.ago(text.seconds(Math.round(ms / 1000)));
  const days = Math.round(ms / 86_400_000);
  return text.ago(days >= 2 ? text.days(days) : formatSpan(ms));
}

/** The date of a moment, "22 Nov", with the year if it is another; empty for today. */
function dateWords(momentMs: number, nowMs: number): string {
  const [at, now] = [new Date(momentMs), new Date(nowMs)];
  if (at.toDateString() === now.toDateString()) return '';
  const month = at.toLocaleDateString(languageTag(), { month: 'short' });
  return pastText().date(
    month,
    at.getDate(),
    at.getFullYear() === now.getFullYear() ? null : at.getFullYear(),
  );
}
