import { MINUTE_MS, PAGE_MS } from '../past_types.ts';
import type { Projector } from './projector.ts';
import { jump, leaveUnkept, type PlayerParts } from './seeking.ts';
import { APART_MS, LOADS_MAX, type Pending, type Reel } from './tape/reel.ts';

/** A gap is played for at most this long; then the rest of it is skipped, ms. */
const GAP_MS = 2000;

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

/** The result of playing or of a step. */
export interface Move {
  /** The moment now shown. */
  readonly momentMs: number;
  /** What must be loaded before it can continue; none if nothing is missing. */
  readonly blockers: readonly Pending[];
}

/** Shows all frames between two moments, stopping where data is not loaded. */
export function playSpan(
  reel: Reel,
  projector: Projector,
  fromMs: number,
  targetMs: number,
): Move & { readonly hasShown: boolean; readonly isDamaged: boolean } {
  const near = reel.near({ fromMs: fromMs - APART_MS, toMs: targetMs + APART_MS });
  const before = projector.cursor;
  let heldMs = Number.POSITIVE_INFINITY;
  let blockers: readonly Pending[] = [];
  for (;;) {
    const next = reel.next(near, projector.cursor, fromMs);
    blockers = reel.blockers(near, next, fromMs);
    const nextMs = next?.frame.atMs ?? Number.POSITIVE_INFINITY;
    if (blockers.length > 0) heldMs = Math.min(nextMs, ...blockers.map((each) => each.fromMs));
    if (next === null || nextMs > targetMs || blockers.length > 0) break;
    projector.deliver(next, near);
  }
  const momentMs = Math.max(fromMs, Math.min(targetMs, heldMs));
  projector.tell(near, momentMs);
  return {
    momentMs,
    blockers: heldMs <= targetMs ? blockers : [],
    hasShown: projector.cursor !== before,
    isDamaged: near.damaged.some((ref) => ref.fromMs <= momentMs && ref.toMs >= fromMs),
  };
}

/** Shows the frame after the shown one, if there is one. */
export function stepForward(reel: Reel, projector: Projector, fromMs: number): Move {
  const momentMs = projector.cursor?.atMs ?? fromMs;
  const nextMs = reel.nextMs(projector.cursor, momentMs) ?? momentMs;
  const near = reel.near({ fromMs: momentMs - APART_MS, toMs: nextMs + APART_MS });
  const next = reel.next(near, projector.cursor, momentMs);
  const blockers = reel.blockers(near, next, momentMs);
  if (blockers.length > 0 || next === null) return { momentMs: fromMs, blockers };
  projector.deliver(next, near);
  return { momentMs: next.frame.atMs, blockers };
}

/** Shows the frame before the shown one, with the state at that time. */
export function stepBack(reel: Reel, projector: Projector, fromMs: number): Move {
  const { cursor } = projector;
  if (cursor === null) return { momentMs: fromMs, blockers: [] };
  const { frame, pending } = reel.before(cursor);
  if (frame === null) return { momentMs: fromMs, blockers: pending };
  const { situation, pending: more } = reel.at(frame.atMs);
  if (situation === null) return { momentMs: fromMs, blockers: more };
  projector.show(frame, frame.atMs, situation);
  return { momentMs: frame.atMs, blockers: [] };
}
