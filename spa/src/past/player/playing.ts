import { playSpan, stepBack, stepForward } from './moves.ts';
import { jump, leaveUnkept, type PlayerParts } from './seeking.ts';
import { PAGE_MS } from './tape/loads.ts';
import { LOADS_MAX } from './tape/reel.ts';

/** A gap is played for at most this long; then the rest of it is skipped, ms. */
const GAP_MS = 2000;
const MINUTE_MS = 60_000;

/** Plays up to now. */
export function playOn(parts: PlayerParts): void {
  const { ports, state, reel, projector } = parts;
  const { clock, loop, recorded } = state;
  const nowMs = ports.nowMs();
  const looped = loop?.toMs ?? recorded?.toMs ?? Number.POSITIVE_INFINITY;
  reel.near({ fromMs: clock.momentMs, toMs: clock.target(nowMs) }); // may move the playhead
  const targetMs = Math.min(clock.target(nowMs), looped);
  const { momentMs, blockers, hasShown, isDamaged } = playSpan(reel, projector, clock.momentMs, targetMs);
  clock.set(momentMs, nowMs);
  state.fetchAndWait(blockers);
  if (isDamaged) state.say('damaged');
  prefetch(parts);
  if (loop === null && state.hasEnded) state.rest();
  else if (momentMs >= looped) jump(parts, loop!.fromMs);
  else if (hasShown) state.shownMs = nowMs;
  else if (momentMs >= state.oldestMs || !leaveUnkept(parts, momentMs))
    passGap(parts, blockers.length > 0, momentMs, nowMs);
}

/** Takes the requested steps, frame by frame, as far as frames are loaded. */
export function goSteps(parts: PlayerParts): void {
  const { state, reel, projector, fill } = parts;
  while (state.steps !== 0) {
    const step = state.steps > 0 ? stepForward : stepBack;
    const { momentMs, blockers } = step(reel, projector, state.clock.momentMs);
    state.fetchAndWait(blockers);
    if (blockers.length > 0) return;
    state.move(momentMs);
    if (state.steps < 0 && projector.cursor !== null) fill.soon(projector.cursor);
    state.steps -= Math.sign(state.steps);
  }
}

/** Skips a gap that has been played for long enough. If nothing follows it, restarts the loop or goes live. */
function passGap(parts: PlayerParts, isHeld: boolean, momentMs: number, nowMs: number): void {
  const { state, reel, projector, goLive } = parts;
  const { clock, loop } = state;
  const isLong = nowMs - state.shownMs >= GAP_MS;
  if (isHeld || (!isLong && clock.speed <= 1)) return;
  const nextMs = reel.nextMs(projector.cursor, momentMs);
  const isFar = nextMs === null || nextMs - momentMs > GAP_MS;
  const unknown = isFar ? reel.unknownAfter(momentMs, nextMs ?? Number.POSITIVE_INFINITY) : null;
  if (unknown !== null) state.fetchAndWait([reel.dayOf(unknown)]);
  else if (nextMs === null) {
    if (loop !== null) jump(parts, loop.fromMs);
    else if (isLong || momentMs >= state.newestMs) goLive();
  } else if (isLong && nextMs - (projector.cursor?.atMs ?? momentMs) > GAP_MS) {
    clock.set(Math.min(nextMs, loop?.toMs ?? nextMs), nowMs);
    state.shownMs = nowMs;
  }
}

function prefetch(parts: PlayerParts): void {
  const { state, tape, reel, loads } = parts;
  const { momentMs, speed } = state.clock;
  for (const ref of reel.ahead(momentMs, speed > 2 ? 6 : 2, 2 * LOADS_MAX)) void loads.segment(ref);
  const soonMs = momentMs + MINUTE_MS / 2;
  if (soonMs <= (state.timeline?.toMs ?? 0)) void loads.index(Math.floor(soonMs / PAGE_MS));
  tape.trim(momentMs);
}
