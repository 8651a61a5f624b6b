import { formatClockSeconds } from '../../twin/format.ts';
import { languageTag } from '../text/language.ts';
import { more } from '../text/more.ts';
import { spanWords } from './span_words.ts';

/** A moment in the viewer's time zone and how long ago it was: "14:02:07 · 2 min ago"; with the date if that was not
 *  today. */
export function momentWords(momentMs: number, nowMs: number): string {
  const [at, now] = [new Date(momentMs), new Date(nowMs)];
  const today = at.toDateString() === now.toDateString();
  const clock = today ? formatClockSeconds(momentMs) : dayWords(momentMs, nowMs);
  return `${clock} · ${agoWords(nowMs - momentMs)}`;
}

/** Hundredths of a second, ".25", to tell frames apart. */
export function hundredthsWords(momentMs: number): string {
  return `.${String(Math.floor((momentMs % 1000) / 10)).padStart(2, '0')}`;
}

/** A moment with its date: "22 Nov 14:02:07"; with the year if it is not this year. */
export function dayWords(momentMs: number, nowMs: number): string {
  const at = new Date(momentMs);
  const year = at.getFullYear();
  const month = at.toLocaleDateString(languageTag(), { month: 'short' });
  const date = more().date(month, at.getDate(), year === new Date(nowMs).getFullYear() ? null : year);
  return `${date} ${formatClockSeconds(momentMs)}`;
}

/** "2 min ago"; at least a second. */
export function agoWords(ageMs: number): string {
  return more().ago(spanWords(Math.max(1000, ageMs)));
}
