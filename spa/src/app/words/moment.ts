import { formatClockSeconds } from '../../twin/format.ts';
import type { PastWords, Verdict } from '../../twin/liveness.ts';
import { languageTag, more, say } from '../text/language.ts';

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

/** A duration in whole units: "9 s", "2 min". */
export function spanWords(ms: number): string {
  const text = say();
  if (ms < 119_500) return text.seconds(Math.round(ms / 1000));
  if (ms < 7_170_000) return text.minutes(Math.round(ms / 60_000));
  const days = Math.round(ms / 86_400_000);
  return days >= 2 ? text.days(days) : text.hours(Math.round(ms / 3_600_000));
}

/** The text for a PAST or RECORDED verdict; empty for others. */
export function pastWords({ past, ageMs }: Pick<Verdict, 'past' | 'ageMs'>, nowMs: number): PastWords {
  if (past === null) return { clock: '', ago: '', note: '' };
  const { momentMs, askedMs, was, isHere, recorded } = past;
  const since = ` · ${recorded?.within(momentMs) ?? agoWords(ageMs ?? 0)}`;
  const clock = recorded?.when(momentMs) ?? formatClockSeconds(momentMs);
  const ago = was === null ? since : `${since} · ${more().was(was)}`;
  const lacks = askedMs && (recorded?.lacks(askedMs, momentMs) ?? notKeptWords(askedMs, momentMs, nowMs));
  const words = (lacks ?? clock) + ago;
  const note = recorded?.note(words) ?? more().pastNote(words);
  const missing = isHere || lacks ? '' : (recorded?.gap(momentMs) ?? more().pastComing);
  return { clock, ago, note: note + missing };
}

/** Whether the note about a moment of the past says more than when it was: that it is not the one asked for, that the robot was
 *  silent, or that it is missing. */
export function saysMore({ past }: Pick<Verdict, 'past'>): boolean {
  if (past === null) return false;
  const { momentMs, askedMs, was, isHere, recorded } = past;
  return askedMs !== null || was !== null || (!isHere && (recorded?.gap(momentMs) ?? null) !== null);
}

/** Says that the moment in the link is not kept, and which one is shown instead. */
export function notKeptWords(askedMs: number, momentMs: number, nowMs: number): string {
  const [asked, clock] = [dayWords(askedMs, nowMs), formatClockSeconds(momentMs)];
  return momentMs > askedMs ? more().notKept(asked, clock) : more().notRecordedAt(asked, clock);
}
