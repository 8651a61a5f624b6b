import { createStore, perObject } from '../../../kit.ts';
import { type PastControls, SPEEDS } from '../../../past/past_types.ts';
import type { KeyHandlers } from '../../shell/page_keys.ts';
import { LEAST_LOOP_MS } from './scrubber.ts';

const MINUTE_MS = 60_000;
const HOUR_MS = 60 * MINUTE_MS;
/** The time spans that a line can show: minutes, hours, days. */
const SCALES_MS = [5 * MINUTE_MS, 30 * MINUTE_MS, 3 * HOUR_MS, 24 * HOUR_MS, 7 * 24 * HOUR_MS] as const;
/** Longer spans are shown only on request: on a line this narrow (CSS px), what is marked would lie over each other. */
const USUAL_MS = { narrow: SCALES_MS[0], wide: 3 * HOUR_MS };
const NARROW_PX = 480;
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

/** The current scale: the chosen one if it exists; otherwise everything, if that is no more than some hours, or minutes on a narrow
 *  line. */
export function scaleIn(windowMs: number, chosenMs: number | null, isNarrow = false): number {
  const usualMs = isNarrow ? USUAL_MS.narrow : USUAL_MS.wide;
  return scaleFor(scalesOf(windowMs), chosenMs ?? (windowMs <= LITTLE * usualMs ? ALL : usualMs));
}

interface ChosenLine {
  /** The scale; null before a choice. */
  readonly scaleMs: number | null;
  /** Whether it is as narrow as on a phone. */
  readonly isNarrow: boolean;
  /** The start of a loop whose end has not been set yet, unix ms. */
  readonly loopStartMs: number | null;
  /** Whether the dialog for going to a moment is open. */
  readonly isJumpOpen: boolean;
}

/** What the viewer has chosen on a time line. */
export const chosenOn = perObject((_: PastControls) =>
  createStore<ChosenLine>({ scaleMs: null, isNarrow: false, loopStartMs: null, isJumpOpen: false }),
);

/** Changes some of it. */
export function chooseOn(controls: PastControls, changed: Partial<ChosenLine>): void {
  const store = chosenOn(controls);
  store.set({ ...store.get(), ...changed });
}

/** Follows the width of the line, CSS px. A recording is shown whole on any. */
export function fitScale(controls: PastControls, widthPx: number): void {
  const isNarrow = widthPx < NARROW_PX && controls.playhead.recorded === null;
  if (isNarrow !== chosenOn(controls).get().isNarrow) chooseOn(controls, { isNarrow });
}

/** The scale of a line whose past is this long. */
function scaleOn(controls: PastControls, windowMs: number): number {
  const { scaleMs, isNarrow } = chosenOn(controls).get();
  return scaleIn(windowMs, scaleMs, isNarrow);
}

/** The length of the shown span, ms. */
export function shownMs(controls: PastControls): number {
  const windowMs = controls.nowMs - (controls.timeline?.fromMs ?? controls.nowMs);
  return Math.min(windowMs, scaleOn(controls, windowMs));
}

/** Shows more (1) or less (-1) of the time. */
export function stepScale(controls: PastControls, by: 1 | -1): void {
  const windowMs = controls.nowMs - (controls.timeline?.fromMs ?? controls.nowMs);
  const scales = scalesOf(windowMs);
  const scaleMs = scales[scales.indexOf(scaleOn(controls, windowMs)) + by];
  if (scaleMs !== undefined) chooseOn(controls, { scaleMs });
}

/** The scale that suits a span best: the longest that is no longer than it, else the finest. */
export function scaleFor(scales: readonly number[], lengthMs: number): number {
  return scales.findLast((ms) => ms <= lengthMs) ?? scales[0]!;
}

/** The step of an arrow key on a line with this span, ms. */
export function arrowMs(lengthMs: number): number {
  return STEPS_MS.findLast((ms) => ms * STEPS_MIN <= lengthMs) ?? STEPS_MS[0];
}

/** The first press sets the start of the loop, the second its end, the third removes it. */
export function pressLoop(controls: PastControls): void {
  const { loop, momentMs } = controls.playhead;
  const { loopStartMs: startMs } = chosenOn(controls).get();
  chooseOn(controls, { loopStartMs: loop === null && startMs === null ? momentMs : null });
  if (loop !== null) controls.setLoop(null);
  else if (startMs !== null) {
    const [fromMs, toMs] = [Math.min(startMs, momentMs), Math.max(startMs, momentMs)];
    if (toMs - fromMs >= LEAST_LOOP_MS) controls.setLoop({ fromMs, toMs });
  }
}

/** What the past's page-wide keys can do at present. `save`: null if there is nothing that can be saved. */
export function pastKeys(controls: PastControls, save: (() => void) | null): KeyHandlers {
  const { at, speed } = controls.playhead;
  if (controls.timeline === null && at === 'live') return {};
  const setSpeed = (by: 1 | -1) => {
    const next = SPEEDS[SPEEDS.indexOf(speed) + by];
    if (next !== undefined) controls.setSpeed(next);
  };
  return {
    play: () => controls.toggle(),
    frameBack: () => controls.step(-1),
    tenBack: () => controls.skip(-10_000),
    faultBack: () => controls.visitFault(-1),
    jump: () => chooseOn(controls, { isJumpOpen: true }),
    ...(save !== null && { save }),
    ...(at === 'past' && {
      frameOn: () => controls.step(1),
      tenOn: () => controls.skip(10_000),
      faultOn: () => controls.visitFault(1),
      slower: () => setSpeed(-1),
      faster: () => setSpeed(1),
      loop: () => pressLoop(controls),
      live: () => controls.goLive(),
    }),
  };
}

/** What the keys of the time line do while it has the focus. `nowMs`: the current time. */
export function lineKeys(controls: PastControls, nowMs: number): KeyHandlers {
  const { at, momentMs } = controls.playhead;
  const fromMs = controls.timeline?.fromMs;
  const go = (arrows: number) => {
    const toMs = momentMs + arrows * arrowMs(shownMs(controls));
    if (toMs < nowMs) controls.seek(Math.max(toMs, fromMs ?? toMs));
    else if (at === 'past') controls.goLive();
  };
  return {
    lineBack: ({ shiftKey }) => go(shiftKey ? -10 : -1),
    lineOn: ({ shiftKey }) => go(shiftKey ? 10 : 1),
    minuteBack: () => go(-60),
    minuteOn: () => go(60),
    oldest: () => controls.seek(fromMs ?? momentMs),
    newest: () => controls.goLive(),
    lineNearer: () => stepScale(controls, -1),
    lineFarther: () => stepScale(controls, 1),
  };
}
