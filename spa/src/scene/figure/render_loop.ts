/** Longest time step of a tick, so that a preceding pause does not count. */
const MAX_STEP_SECONDS = 0.1;

/** Something in the scene that moves on its own for a while. */
export interface Moving {
  /** Advances by `seconds` to `nowMs` (the viewer's clock). True while it needs more ticks. */
  advance(seconds: number, nowMs: number): boolean;
}

/** Schedules a tick: by default at the browser's next repaint, with its time as ms since 1970, like the stream's clock; tests
 *  pass their own function. */
export type Schedule = (tick: (nowMs: number) => void) => void;

const NEXT_REPAINT: Schedule = (tick) => requestAnimationFrame((ms) => tick(performance.timeOrigin + ms));

/**
 * Draws pictures on demand with `requestAnimationFrame`. A tick happens only on request, and requests the next one only while
 * something still moves, so that an unchanged robot costs nothing.
 */
export class RenderLoop {
  /** Pictures drawn so far. */
  renderedFrames = 0;
  /** Ticks so far, including those that drew nothing. */
  ticks = 0;
  readonly #draw: () => boolean;
  readonly #schedule: Schedule;
  readonly #moving = new Set<Moving>();
  /** Gets the time between two repaints, ms, if something moved all that time. */
  onInterval: ((ms: number) => void) | null = null;
  #inMotion = false;
  #requested = false;
  #dirty = false;
  #stopped = false;
  #lastMs = 0;

  /** `draw` draws a picture and returns false if it could not (lost context). */
  constructor(draw: () => boolean, schedule: Schedule = NEXT_REPAINT) {
    this.#draw = draw;
    this.#schedule = schedule;
  }

  /** Whether no tick is scheduled: the newest picture stays until something changes. */
  get resting(): boolean {
    return !this.#requested;
  }

  /** Advances `moving` in every tick. Returns a function that removes it. */
  add(moving: Moving): () => void {
    this.#moving.add(moving);
    return () => this.#moving.delete(moving);
  }

  /** Requests a picture, because something changed. */
  request(): void {
    this.#dirty = true;
    this.wake();
  }

  /** Requests a tick, because something may have started to move. A picture is drawn only if something requests it. */
  wake(): void {
    if (this.#requested || this.#stopped) return;
    this.#requested = true;
    this.#schedule(this.#tick);
  }

  /** Draws at once instead of at the next tick, for example because a resized canvas is blank. */
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
    this.#requested = false; // requests made during this tick have been served
    if (more) this.wake();
  };
}
