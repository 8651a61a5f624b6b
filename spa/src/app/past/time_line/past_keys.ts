import { type PastControls, SPEEDS } from '../../../past/past_types.ts';
import type { KeyHandlers } from '../../shell/page_keys.ts';
import { momentSheet } from './jump/moment_sheet.ts';
import { pressLoop } from './loop_start.ts';
import { arrowMs, shownMs, stepScale } from './scales.ts';

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
    jump: () => momentSheet.set(controls),
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
