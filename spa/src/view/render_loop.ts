/** A tick after a pause must not count the pause. */
const MAX_STEP_SECONDS = 0.1;

/** Something in the scene that moves by itself for a while. */
export interface Moving {
  /** Moves on by so many seconds to `nowMs` (the viewer's clock). True while it needs more ticks. */
  advance(seconds: number, nowMs: number): boolean;
}

/** How ticks are asked for: the browser's next repaint (its time as ms since 1970, as the stream's clock has it), or a
 *  test's own. */
export type Schedule = (tick: (nowMs: number) => void) => void;

const NEXT_REPAINT: Schedule = (tick) => requestAnimationFrame((ms) => tick(performance.timeOrigin + ms));

/**
 * The one owner of `requestAnimationFrame`. A tick happens only when somebody asked for one, and asks for the next
 * only while something still moves: an unchanged robot costs no frames.
 */
export class RenderLoop {
  /** Pictures drawn so far. */
  renderedFrames = 0;
  /** Ticks so far; some find nothing to draw. */
  ticks = 0;
  readonly #draw: () => boolean;
  readonly #schedule: Schedule;
  readonly #moving = new Set<Moving>();
  /** Hears how long a repaint took in which something moved all the time. */
  onInterval: ((ms: number) => void) | null = null;
  #inMotion = false;
  #requested = false;
  #dirty = false;
  #stopped = false;
  #lastMs = 0;

  /** `draw` makes a picture of what is; false when it could not (a lost context). */
  constructor(draw: () => boolean, schedule: Schedule = NEXT_REPAINT) {
    this.#draw = draw;
    this.#schedule = schedule;
  }

  /** Nothing is asked for: the newest picture stays until something happens. */
  get resting(): boolean {
    return !this.#requested;
  }

  /** Lets something take part in every tick until it is taken out again. */
  add(moving: Moving): () => void {
    this.#moving.add(moving);
    return () => this.#moving.delete(moving);
  }

  /** Something changed: a picture of it is wanted. */
  request(): void {
    this.#dirty = true;
    this.wake();
  }

  /** Something may have begun to move: it is asked in the next tick, and drawn only if it says that it changed. */
  wake(): void {
    if (this.#requested || this.#stopped) return;
    this.#requested = true;
    this.#schedule(this.#tick);
  }

  /** Draws at once, for what can't wait: a resized canvas is blank until it is drawn. */
  drawNow(): void {
    this.#dirty = false;
    if (!this.#stopped && this.#draw()) this.renderedFrames += 1;
  }

  stop(): void {
    this.#stopped = true;
  }

  readonly #tick = (nowMs: number): void => {
    if (this.#stopped) return;
    this.ticks += 1;
    const passedMs = Math.max(0, nowMs - this.#lastMs);
    const seconds = Math.min(passedMs / 1000, MAX_STEP_SECONDS);
    this.#lastMs = nowMs;
    let more = false;
    for (const moving of this.#moving) more = moving.advance(seconds, nowMs) || more;
    const drawn = this.#dirty;
    if (drawn) this.drawNow();
    if (this.#inMotion) this.onInterval?.(passedMs);
    this.#inMotion = drawn && more;
    this.#requested = false; // what was asked for meanwhile has been drawn
    if (more) this.wake();
  };
}
