import { useRef } from 'react';
import type { Playhead } from '../../../past/past_types.ts';
import { pastText } from '../../text/late.ts';
import { momentWords } from '../../words/moment.ts';

/** While playing, a moment this near to the expected one was not a seek, ms. */
const EXPECTED_MS = 700;
/** While playing, the text is updated this often, ms. */
const ANEW_MS = 30_000;

export interface Spoken {
  readonly words: string;
  /** How long ago the moment was, whole seconds; 0: live. */
  readonly agoS: number;
}

interface Told extends Spoken {
  readonly playhead: Playhead;
  readonly language: object;
  readonly nowMs: number;
}

/** The playhead for screen readers, which announce each change: it changes after a seek, not during playback. */
export function useSpoken(playhead: Playhead, nowMs: number): Spoken {
  const told = useRef<Told | null>(null);
  if (told.current === null || !stillTrue(told.current, playhead, nowMs))
    told.current = { ...spokenOf(playhead, nowMs), playhead, language: pastText(), nowMs };
  return told.current;
}

function stillTrue(told: Told, playhead: Playhead, nowMs: number): boolean {
  const before = told.playhead;
  if (before.at !== playhead.at || told.language !== pastText()) return false;
  if (playhead.at === 'live') return true;
  if (before.playing !== playhead.playing || before.speed !== playhead.speed) return false;
  const sinceMs = nowMs - told.nowMs;
  if (sinceMs > ANEW_MS) return false;
  const expectedMs = before.momentMs + (playhead.playing ? sinceMs * playhead.speed : 0);
  return Math.abs(playhead.momentMs - expectedMs) < (playhead.playing ? EXPECTED_MS * playhead.speed : 1);
}

/** A moment of the past, and how long ago it was; of a recording, how far into it. */
export function whenWords({ recorded }: Pick<Playhead, 'recorded'>, momentMs: number, nowMs: number): string {
  if (recorded === null) return momentWords(momentMs, nowMs);
  return `${recorded.when(momentMs)} · ${recorded.within(momentMs)}`;
}

/** "14:02:07 · 2 min ago, playing at 1×". */
export function spokenOf(playhead: Playhead, nowMs: number): Spoken {
  const { at, momentMs, playing, speed } = playhead;
  const text = pastText();
  if (at === 'live') return { words: text.live, agoS: 0 };
  const words = whenWords(playhead, momentMs, nowMs).replace(' · ', ', ');
  return {
    words: `${words}, ${playing ? text.playingAt(speedWords(speed)) : text.paused}`,
    agoS: Math.max(playhead.recorded === null ? 1 : 0, Math.round((nowMs - momentMs) / 1000)),
  };
}

const FRACTIONS: Readonly<Record<number, string>> = { 0.25: '¼', 0.5: '½' };

/** "½×". */
export function speedWords(speed: number): string {
  return `${FRACTIONS[speed] ?? speed}×`;
}
