import type { Projector } from './projector.ts';
import { APART_MS, type Pending, type Reel } from './tape/reel.ts';

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
