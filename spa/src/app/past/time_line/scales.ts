import { storePer } from '../../../kit.ts';
import type { PastControls } from '../../../past/past_types.ts';

const MINUTE_MS = 60_000;
const HOUR_MS = 60 * MINUTE_MS;
/** The time spans that a line can show: minutes, hours, days. */
const SCALES_MS = [5 * MINUTE_MS, 30 * MINUTE_MS, 3 * HOUR_MS, 24 * HOUR_MS, 7 * 24 * HOUR_MS] as const;
/** Longer spans are shown only on request. */
const USUAL_MS = 3 * HOUR_MS;
/** A past only slightly longer than a scale is shown whole. */
const LITTLE = 1.2;
/** The step of an arrow key, ms. */
const STEPS_MS = [1000, 10_000, MINUTE_MS, 10 * MINUTE_MS] as const;
/** The minimum number of arrow-key steps along a line. */
const STEPS_MIN = 1000;

/** The whole past. */
export const ALL = Number.POSITIVE_INFINITY;

/** The scales for a past of this length, finest first; the last is `ALL`, unless that is too long for a line. */
export function scalesOf(windowMs: number): readonly number[] {
  const shorter = SCALES_MS.filter((ms) => LITTLE * ms < windowMs);
  return shorter.length === SCALES_MS.length ? shorter : [...shorter, ALL];
}

/** The current scale: the chosen one if it exists; otherwise everything, if that is no more than some hours. */
export function scaleIn(windowMs: number, chosen: number | null): number {
  const scales = scalesOf(windowMs);
  const wanted = chosen ?? (windowMs <= LITTLE * USUAL_MS ? ALL : USUAL_MS);
  return scaleFor(scales, wanted);
}

/** The scale chosen by the viewer; null before a choice. */
export const chosenScale = storePer<PastControls, number | null>(null);

/** The length of the shown span, ms. */
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

/** The scale that suits a span best: the longest that is no longer than it, else the finest. */
export function scaleFor(scales: readonly number[], lengthMs: number): number {
  return scales.findLast((ms) => ms <= lengthMs) ?? scales[0]!;
}

/** The step of an arrow key on a line with this span, ms. */
export function arrowMs(lengthMs: number): number {
  return STEPS_MS.findLast((ms) => ms * STEPS_MIN <= lengthMs) ?? STEPS_MS[0];
}
