import { storePer } from '../../../../browser/store.ts';
import type { PastControls } from '../../../../past/past_types.ts';

const MINUTE_MS = 60_000;
const HOUR_MS = 60 * MINUTE_MS;
/** How much of the time a line may show: minutes, hours, days. */
const SCALES_MS = [5 * MINUTE_MS, 30 * MINUTE_MS, 3 * HOUR_MS, 24 * HOUR_MS, 7 * 24 * HOUR_MS] as const;
/** No longer line is shown unless somebody asks for it. */
const USUAL_MS = 3 * HOUR_MS;
/** What is little longer than a scale is shown whole. */
const LITTLE = 1.2;
/** How far an arrow key goes, ms. */
const STEPS_MS = [1000, 10_000, MINUTE_MS, 10 * MINUTE_MS] as const;
/** How many arrow keys a line is long, at least. */
const STEPS_MIN = 1000;

/** All there is. */
export const ALL = Number.POSITIVE_INFINITY;

/** The scales that a past of this length has, finest first; the last is `ALL`, unless that is too long for a line. */
export function scalesOf(windowMs: number): readonly number[] {
  const shorter = SCALES_MS.filter((ms) => LITTLE * ms < windowMs);
  return shorter.length === SCALES_MS.length ? shorter : [...shorter, ALL];
}

/** The scale that is shown: the one that was chosen, as far as there is such; else all, if that is no more than some hours. */
export function scaleIn(windowMs: number, chosen: number | null): number {
  const scales = scalesOf(windowMs);
  const wanted = chosen ?? (windowMs <= LITTLE * USUAL_MS ? ALL : USUAL_MS);
  return scaleFor(scales, wanted);
}

/** The scale that somebody chose; null before. */
export const chosenScale = storePer<PastControls, number | null>(null);

/** How much is shown, ms. */
export function shownMs(controls: PastControls): number {
  const windowMs = controls.nowMs - (controls.timeline?.fromMs ?? controls.nowMs);
  return Math.min(windowMs, scaleIn(windowMs, chosenScale(controls).get()));
}

/** Shows more (1) or less (-1) of the time. */
export function stepScale(controls: PastControls, by: 1 | -1): void {
  const windowMs = controls.nowMs - (controls.timeline?.fromMs ?? controls.nowMs);
  const scales = scalesOf(windowMs);
  const store = chosenScale(controls);
  const next = scales[scales.indexOf(scaleIn(windowMs, store.get())) + by];
  if (next !== undefined) store.set(next);
}

/** The scale at which so much is seen well: the longest that is no longer, else the finest. */
export function scaleFor(scales: readonly number[], lengthMs: number): number {
  return scales.findLast((ms) => ms <= lengthMs) ?? scales[0]!;
}

/** How far an arrow key goes on a line that shows so much, ms. */
export function arrowMs(lengthMs: number): number {
  return STEPS_MS.findLast((ms) => ms * STEPS_MIN <= lengthMs) ?? STEPS_MS[0];
}
