import { storePer } from '../../../kit.ts';
import type { PastControls } from '../../../past/past_types.ts';
import { LEAST_LOOP_MS } from './scrubber.ts';

/** The start of a loop whose end has not been set yet, unix ms. */
export const loopStart = storePer<PastControls, number | null>(null);

/** The first press sets the start of the loop, the second its end, the third removes it. */
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
