import { formatClockSeconds } from '../../twin/format.ts';
import type { PastWords, Verdict } from '../../twin/liveness.ts';
import { more } from '../text/more.ts';
import { agoWords, dayWords } from './moment.ts';

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

/** Says that the moment in the link is not kept, and which one is shown instead. */
export function notKeptWords(askedMs: number, momentMs: number, nowMs: number): string {
  const [asked, clock] = [dayWords(askedMs, nowMs), formatClockSeconds(momentMs)];
  return momentMs > askedMs ? more().notKept(asked, clock) : more().notRecordedAt(asked, clock);
}
