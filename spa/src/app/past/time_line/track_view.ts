import type { Span } from '../../../past/past_types.ts';

/** What the short range shows, ms. */
export const RECENT_MS = 300_000;
/** No line is shorter than this, ms. */
const LEAST_MS = 60_000;
/** How far moments stay away from the ends of the track, CSS px, so that no handle or mark is cut. */
export const PAD_PX = 7;

export type Range = 'all' | 'recent';

/** A part of the time and the width over which it is drawn, CSS px. */
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

/** The part of the time that is shown: all there is, at least a minute; or the five minutes that end now if the shown
 *  moment is in them, else five that contain it and stand still as long as they do. `before`: what was shown before. */
export function shownSpan(whole: Span, range: Range, momentMs: number, before: Span | null): Span {
  const { fromMs, toMs } = whole;
  const newest = { fromMs: toMs - RECENT_MS, toMs };
  if (range === 'all') return { fromMs: Math.min(fromMs, toMs - LEAST_MS), toMs };
  if (momentMs >= newest.fromMs) return newest;
  const isPage = before !== null && Math.abs(before.toMs - before.fromMs - RECENT_MS) < 1;
  if (isPage && contains(before, momentMs)) return before;
  const part = before === null || contains(before, momentMs) ? 0.5 : momentMs > before.toMs ? 0.1 : 0.9;
  const wanted = Math.max(fromMs, momentMs - part * RECENT_MS);
  const from = Math.min(wanted, newest.fromMs, momentMs);
  return { fromMs: from, toMs: from + RECENT_MS };
}

export function contains({ fromMs, toMs }: Span, momentMs: number): boolean {
  return momentMs >= fromMs && momentMs <= toMs;
}

/** Distances of ticks, seconds. */
const STEPS_S = [5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 21_600, 86_400] as const;
const LABEL_PX = 76;
const TICK_PX = 9;

export interface Tick {
  readonly atMs: number;
  /** Whether its time is written to it. */
  readonly labelled: boolean;
}

/** Ticks at round times of the viewer's zone, and how far apart those with a time are, seconds. `offsetMs`: of the zone, to
 *  be added to UTC. */
export function ticksOf(view: View, offsetMs: number): { ticks: Tick[]; labelS: number } {
  const apart = (leastPx: number) => {
    const leastS = (leastPx * msPerPx(view)) / 1000;
    return STEPS_S.find((step) => step >= leastS) ?? STEPS_S.at(-1)!;
  };
  const labelS = apart(LABEL_PX);
  // A tick that is not part of the labels' step would stand between them at odd places.
  const tickS = [apart(TICK_PX), ...STEPS_S].find((step) => step >= apart(TICK_PX) && labelS % step === 0)!;
  const ticks: Tick[] = [];
  for (let local = roundUp(view.fromMs + offsetMs, tickS * 1000); ; local += tickS * 1000) {
    const atMs = local - offsetMs;
    if (atMs > view.toMs) return { ticks, labelS };
    ticks.push({ atMs, labelled: local % (labelS * 1000) === 0 });
  }
}

function roundUp(value: number, step: number): number {
  return Math.ceil(value / step) * step;
}
