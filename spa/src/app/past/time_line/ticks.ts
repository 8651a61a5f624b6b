import type { Span } from '../../../past/past_types.ts';
import { formatClock, formatClockSeconds } from '../../../twin/format.ts';
import { languageTag, more } from '../../text/language.ts';

/** A tick on the line's lower edge; most have no label. */
export interface Tick {
  readonly atMs: number;
  readonly label: string | null;
}

/** The line's position on the screen, and its letter width: CSS px. */
export interface Lines {
  readonly pxAt: (atMs: number) => number;
  readonly widthPx: number;
  readonly textPx: number;
}

const MINUTE_MS = 60_000;
const DAY_MS = 1440 * MINUTE_MS;
/** Distances of ticks, ms; from a day on, by the days of the calendar. */
const STEPS_MS = [
  ...[5, 10, 15, 30].map((s) => s * 1000),
  ...[1, 2, 5, 10, 15, 30, 60, 120, 180, 360, 720].map((min) => min * MINUTE_MS),
  ...[1, 2, 4, 7, 14, 28].map((days) => days * DAY_MS),
];
/** Minimum distance between two labels, and between two ticks without labels, CSS px. */
const GAP_PX = 12;
const TICK_PX = 9;
const TICKS_MAX = 600;

/** Ticks at round times of the viewer's clock. As many have labels as can be read. */
export function listTicks(span: Span, lines: Lines): readonly Tick[] {
  const msPerPx = (span.toMs - span.fromMs) / Math.max(1, lines.pxAt(span.toMs) - lines.pxAt(span.fromMs));
  let tooMany: readonly Labelled[] = [];
  for (const stepMs of STEPS_MS) {
    if ((span.toMs - span.fromMs) / stepMs > TICKS_MAX || stepMs < TICK_PX * msPerPx) continue;
    const found = labelsOf(span, stepMs, lines);
    if (!canBeRead(found, lines)) {
      tooMany = found;
      continue;
    }
    const fineMs = STEPS_MS.find((ms) => ms >= TICK_PX * msPerPx && stepMs % ms === 0) ?? stepMs;
    // if only one label fits, it is one of the omitted ones
    const labels = found.length > 0 ? found : tooMany.slice(0, 1);
    const words = new Map(labels.map(({ atMs, label }) => [atMs, label]));
    const all = new Set([...roundTimes(span, fineMs), ...words.keys()]);
    return [...all]
      .sort((one, other) => one - other)
      .map((atMs) => ({ atMs, label: words.get(atMs) ?? null }));
  }
  return [];
}

type Labelled = Tick & { readonly label: string };

/** Half the width of a label, CSS px: an upper bound for all fonts of the page. */
export function halfPx(words: string, textPx: number): number {
  let em = 0;
  for (const letter of words) em += letter > '\u2e80' ? 1 : letter === ' ' || letter === ':' ? 0.35 : 0.64;
  return (em * textPx) / 2;
}

/** A day: "22 Nov". */
function dateWords(atMs: number): string {
  const at = new Date(atMs);
  return more().date(at.toLocaleDateString(languageTag(), { month: 'short' }), at.getDate(), null);
}

/** Drops labels that would be cut at an end of the line. */
function labelsOf(span: Span, stepMs: number, { pxAt, widthPx, textPx }: Lines) {
  return roundTimes(span, stepMs)
    .map((atMs) => ({ atMs, label: wordsOf(atMs, stepMs) }))
    .filter(({ atMs, label }) => {
      const [px, half] = [pxAt(atMs), halfPx(label, textPx)];
      return px >= half && px <= widthPx - half;
    });
}

function wordsOf(atMs: number, stepMs: number): string {
  const at = new Date(atMs);
  const isDay = at.getHours() + at.getMinutes() + at.getSeconds() === 0;
  if (stepMs >= DAY_MS || isDay) return dateWords(atMs);
  return stepMs < MINUTE_MS ? formatClockSeconds(atMs) : formatClock(atMs);
}

function canBeRead(labels: readonly Labelled[], { pxAt, textPx }: Lines): boolean {
  return labels.every(({ atMs, label }, i) => {
    const next = labels[i + 1];
    if (next === undefined) return true;
    return pxAt(next.atMs) - pxAt(atMs) >= halfPx(label, textPx) + halfPx(next.label, textPx) + GAP_PX;
  });
}

/** The moments in a span at which the viewer's clock is at a multiple of a step, oldest first. */
export function roundTimes(span: Span, stepMs: number): number[] {
  return stepMs >= DAY_MS ? roundDays(span, stepMs / DAY_MS) : roundClock(span, stepMs);
}

function roundClock({ fromMs, toMs }: Span, stepMs: number): number[] {
  const found: number[] = [];
  for (let atMs = nextRound(fromMs - 1, stepMs); atMs <= toMs; atMs = nextRound(atMs, stepMs))
    found.push(atMs);
  return found;
}

/** The first moment after another at which the clock is round. If the clock changes meanwhile (summer time), the new time
 *  counts. */
function nextRound(afterMs: number, stepMs: number): number {
  const before = offsetMs(afterMs);
  const plain = roundUp(afterMs + before + 1, stepMs) - before;
  const change = offsetMs(plain) - before;
  if (change === 0) return plain;
  // the same reading on the clock as it is then, if that moment exists
  return [plain - change, plain, roundUp(plain + before + change, stepMs) - before - change]
    .filter((atMs) => atMs > afterMs && (atMs + offsetMs(atMs)) % stepMs === 0)
    .reduce((first, atMs) => Math.min(first, atMs), Number.POSITIVE_INFINITY);
}

/** The start of every n-th day. */
function roundDays({ fromMs, toMs }: Span, days: number): number[] {
  const found: number[] = [];
  const from = new Date(fromMs);
  for (let i = 0; ; i += 1) {
    const day = new Date(from.getFullYear(), from.getMonth(), from.getDate() + i);
    if (day.getTime() > toMs) return found;
    const number = Date.UTC(day.getFullYear(), day.getMonth(), day.getDate()) / DAY_MS;
    if (day.getTime() >= fromMs && number % days === 0) found.push(day.getTime());
  }
}

/** The viewer's clock minus UTC. */
function offsetMs(atMs: number): number {
  return -new Date(atMs).getTimezoneOffset() * MINUTE_MS;
}

function roundUp(value: number, step: number): number {
  return Math.ceil(value / step) * step;
}
