import { createStore, type Store } from '../../../browser/store.ts';
import type { PastControls } from '../../../past/past_types.ts';
import { LEAST_LOOP_MS } from './scrubber.ts';

const starts = new WeakMap<PastControls, Store<number | null>>();

/** Where somebody said that a loop starts who has not yet said where it ends, unix ms. */
export function loopStart(controls: PastControls): Store<number | null> {
  const known = starts.get(controls) ?? createStore<number | null>(null);
  starts.set(controls, known);
  return known;
}

/** The first press says where the loop starts, the second where it ends, the third ends it. */
export function pressLoop(controls: PastControls): void {
  const start = loopStart(controls);
  const { loop, momentMs } = controls.playhead;
  const startMs = start.get();
  if (loop !== null) {
    start.set(null);
    controls.setLoop(null);
  } else if (startMs === null) start.set(momentMs);
  else {
    start.set(null);
    const [fromMs, toMs] = [Math.min(startMs, momentMs), Math.max(startMs, momentMs)];
    if (toMs - fromMs >= LEAST_LOOP_MS) controls.setLoop({ fromMs, toMs });
  }
}
