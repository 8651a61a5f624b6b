import { formatClockSeconds } from '../../twin/format.ts';
import type { PastWords, Verdict } from '../../twin/liveness.ts';
import { more } from '../text/more.ts';
import { agoWords, dayWords } from './moment_words.ts';

/** What is said of a verdict of PAST or RECORDED; empty of others. */
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

/** Says that the moment that a link names is not kept, and which is shown instead. */
export function notKeptWords(askedMs: number, momentMs: number, nowMs: number): string {
  const [asked, clock] = [dayWords(askedMs, nowMs), formatClockSeconds(momentMs)];
  return momentMs > askedMs ? more().notKept(asked, clock) : more().notRecordedAt(asked, clock);
}
