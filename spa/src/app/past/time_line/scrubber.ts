import type { PastControls, Span } from '../../../past/past_types.ts';
import { BEFORE_MS, contains, markNear, msAt, pxAt, type View } from './track_view.ts';

/** How far a pointer may move between press and release to be a tap, CSS px. */
const TAP_PX = 4;
/** How near a press has to come to an end of the loop to take it, CSS px. */
const HANDLE_PX = { mouse: 6, touch: 14 };
/** A release this near to the right end means now, CSS px. */
const END_PX = 3;
/** The minimum length of a loop, ms. */
export const LEAST_LOOP_MS = 200;

export interface Press {
  readonly xPx: number;
  readonly shift: boolean;
  readonly touch: boolean;
}

type Hold =
  | { readonly kind: 'seek'; readonly view: View; readonly nowMs: number; readonly startPx: number }
  | { readonly kind: 'loop'; readonly view: View; readonly fixedMs: number; readonly startPx: number };

/** Turns pointer actions on the track into moments and loops. */
export class Scrubber {
  readonly #controls: PastControls;
  readonly #nextFrame: (run: () => void) => () => void;
  readonly #onDraft: (loop: Span | null) => void;
  #hold: Hold | null = null;
  #moved = false;
  #draft: Span | null = null;
  /** The pending seek, executed at the next frame. */
  #wantedMs: number | null = null;
  /** The last seek, so that a release at the same place need not repeat it. */
  #soughtMs: number | null = null;
  #cancelFrame: (() => void) | null = null;

  /** `nextFrame` calls back before the next picture and returns a function that cancels it; `onDraft` receives the loop being
   *  drawn. */
  constructor(
    controls: PastControls,
    nextFrame: (run: () => void) => () => void,
    onDraft: (loop: Span | null) => void,
  ) {
    this.#controls = controls;
    this.#nextFrame = nextFrame;
    this.#onDraft = onDraft;
  }

  get held(): boolean {
    return this.#hold !== null;
  }

  /** A press; the view is fixed until the release. `nowMs`: the current time, where Live is. */
  down(view: View, nowMs: number, { xPx, shift, touch }: Press): void {
    this.#moved = false;
    this.#soughtMs = null;
    const fixedMs = shift ? msAt(view, xPx) : this.#oppositeEnd(view, xPx, touch);
    if (fixedMs !== null) {
      this.#hold = { kind: 'loop', view, fixedMs, startPx: xPx };
      return;
    }
    this.#hold = { kind: 'seek', view, nowMs, startPx: xPx };
    this.#controls.attend();
    const mark = markNear(this.#controls.timeline?.marks ?? [], view, xPx);
    this.#controls.seek(mark === null ? msAt(view, xPx) : mark.atMs - BEFORE_MS, true);
  }

  move(xPx: number): void {
    const hold = this.#hold;
    if (hold === null) return;
    if (Math.abs(xPx - hold.startPx) >= TAP_PX) this.#moved = true;
    if (!this.#moved) return;
    const atMs = msAt(hold.view, xPx);
    if (hold.kind === 'loop') {
      this.#draft = { fromMs: Math.min(hold.fixedMs, atMs), toMs: Math.max(hold.fixedMs, atMs) };
      this.#onDraft(this.#draft);
      return;
    }
    this.#wantedMs = atMs;
    this.#cancelFrame ??= this.#nextFrame(() => {
      this.#cancelFrame = null;
      this.#seekWanted();
    });
  }

  up(xPx: number): void {
    this.move(xPx);
    const hold = this.#hold;
    if (hold?.kind === 'seek' && xPx >= pxAt(hold.view, hold.nowMs) - END_PX)
      this.#end(() => this.#controls.goLive());
    else this.cancel();
  }

  /** The release, also if the system cancels the pointer. */
  cancel(): void {
    const draft = this.#draft;
    if (this.#hold?.kind === 'seek') this.#end(() => this.#controls.settle());
    else
      this.#end(() => {
        if (draft !== null && draft.toMs - draft.fromMs >= LEAST_LOOP_MS) this.#loop(draft);
      });
  }

  #loop(span: Span): void {
    const { playhead } = this.#controls;
    this.#controls.setLoop(span);
    if (playhead.at === 'live' || !contains(span, playhead.momentMs)) this.#controls.seek(span.fromMs);
  }

  #end(last: () => void): void {
    if (this.#hold === null) return;
    this.#hold = null;
    this.#cancelFrame?.();
    this.#cancelFrame = null;
    this.#seekWanted();
    if (this.#draft !== null) this.#onDraft(null);
    this.#draft = null;
    last();
  }

  #seekWanted(): void {
    if (this.#wantedMs !== null && this.#wantedMs !== this.#soughtMs) {
      this.#soughtMs = this.#wantedMs;
      this.#controls.seek(this.#wantedMs, true);
    }
    this.#wantedMs = null;
  }

  /** The end of the loop that stays while the pressed one moves; null if none was pressed. */
  #oppositeEnd(view: View, xPx: number, touch: boolean): number | null {
    const { loop } = this.#controls.playhead;
    if (loop === null) return null;
    const reach = touch ? HANDLE_PX.touch : HANDLE_PX.mouse;
    const [from, to] = [Math.abs(pxAt(view, loop.fromMs) - xPx), Math.abs(pxAt(view, loop.toMs) - xPx)];
    if (Math.min(from, to) > reach) return null;
    return from < to ? loop.toMs : loop.fromMs;
  }
}
