import type { Mark, Span } from '../../../past/past_types.ts';

/** The minimum span of a line, ms. */
const LEAST_MS = 60_000;
/** The distance of moments from the ends of the track, CSS px, so that no handle or mark is cut. */
const PAD_PX = 7;

/** A span of time, and the width over which it is drawn, CSS px. */
export interface View extends Span {
  readonly widthPx: number;
}

export function pxAt(view: View, momentMs: number): number {
  const part = (momentMs - view.fromMs) / (view.toMs - view.fromMs);
  return PAD_PX + part * (view.widthPx - 2 * PAD_PX);
}

/** The moment at a place, within the view. */
export function msAt(view: View, xPx: number): number {
  const part = (xPx - PAD_PX) / Math.max(1, view.widthPx - 2 * PAD_PX);
  return view.fromMs + Math.min(1, Math.max(0, part)) * (view.toMs - view.fromMs);
}

/** How long one CSS px is, ms. */
export function msPerPx({ fromMs, toMs, widthPx }: View): number {
  return (toMs - fromMs) / Math.max(1, widthPx - 2 * PAD_PX);
}

/** The shown span: the whole past (at least a minute) if it is no longer than `lengthMs`. Otherwise the span of that length that
 *  ends now, if it contains the shown moment; else one that contains it and stays fixed as long as it does. `before`: the
 *  previous span. */
export function shownSpan(whole: Span, lengthMs: number, momentMs: number, before: Span | null): Span {
  const { fromMs, toMs } = whole;
  if (lengthMs >= toMs - fromMs) return { fromMs: Math.min(fromMs, toMs - LEAST_MS), toMs };
  const newest = { fromMs: toMs - lengthMs, toMs };
  if (momentMs >= newest.fromMs) return newest;
  const isPage = before !== null && Math.abs(before.toMs - before.fromMs - lengthMs) < 1;
  if (isPage && contains(before, momentMs)) return before;
  const part = before === null || contains(before, momentMs) ? 0.5 : momentMs > before.toMs ? 0.1 : 0.9;
  const wanted = Math.max(fromMs, momentMs - part * lengthMs);
  const from = Math.min(wanted, newest.fromMs, momentMs);
  return { fromMs: from, toMs: from + lengthMs };
}

export function contains({ fromMs, toMs }: Span, momentMs: number): boolean {
  return momentMs >= fromMs && momentMs <= toMs;
}

/** From this height on, a row has larger text, because the screen is large or far away. */
const LARGE_PX = { open: 70, slim: 44 } as const;

/** The text size below the curve in a track of this height, CSS px. */
export function textPxOf(heightPx: number, open: boolean): number {
  return heightPx >= LARGE_PX[open ? 'open' : 'slim'] ? 15 : 12;
}

/** Half the width of the playhead's time, CSS px, or a little more: a tip keeps this distance. */
export const TIME_PX = 48;

/** The pointer's position on the track, CSS px. `touch`: a finger, which covers what is under it. */
export interface Hover {
  readonly xPx: number;
  readonly touch: boolean;
}

/** The maximum distance of a tap from a mark, CSS px. */
const NEAR_PX = 10;
/** A tap on a mark starts this long before it, to show what led up to it, ms. */
export const BEFORE_MS = 2000;

/** The mark hit by a tap: the nearest fault, else the nearest caution; null if none is near. */
export function markNear(marks: readonly Mark[], view: View, xPx: number): Mark | null {
  const near = marksNear(marks, view, xPx);
  return near.find(({ level }) => level === 'fault') ?? near[0] ?? null;
}

export function marksNear(marks: readonly Mark[], view: View, xPx: number): Mark[] {
  const far = ({ atMs }: Mark) => Math.abs(pxAt(view, atMs) - xPx);
  return marks.filter((mark) => far(mark) <= NEAR_PX).sort((a, b) => far(a) - far(b));
}
