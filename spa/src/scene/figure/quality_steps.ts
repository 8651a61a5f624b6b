/**
 * Decides how much quality a slow device gives up, and when it gets it back. Pure: it takes the times between repaints of a
 * moving picture and returns a quality step.
 *
 * It goes one step down if half of the newest repaints took too long, and one step up only after a long fast period. If going up
 * was too early, the next fast period must be twice as long, so that the quality does not oscillate.
 */

/** Repaints that take longer are slow: fewer than 20 pictures a second. */
export const SLOW_MS = 50;
/** Repaints that take less leave enough time to try the next better step. */
export const CALM_MS = 24;
/** How many repaints are judged together. */
export const WINDOW = 10;
/** Fewer repaints are enough if together they have taken this long. */
export const FEWEST = 5;
export const LONG_ENOUGH_MS = 3000;
export const FIRST_CALM_MS = 8000;
export const LONGEST_CALM_MS = 256_000;
/** If the lowest step still draws fewer than ten pictures a second for this many windows, 3D drawing is hopeless. */
export const HOPELESS_MS = 100;
export const HOPELESS_WINDOWS = 2;
/** A longer time does not count as a slow repaint: the page was hidden, or the machine slept. */
const PAUSE_MS = 4000;
/** Above this, one step down is not enough: two are taken. */
const VERY_SLOW_MS = 600;

/** Quality steps from best to worst. `pixels`: fraction of the screen's pixels along each side; `shadow`: the same for the shadow
 *  map; `lowest`: whether the coarsest level of detail is used. */
export const STEPS = [
  { pixels: 1, shadow: 1, lowest: false },
  { pixels: 0.75, shadow: 0.5, lowest: false },
  { pixels: 0.5, shadow: 0.25, lowest: false },
  { pixels: 0.5, shadow: 0.25, lowest: true },
  { pixels: 0.35, shadow: 0.125, lowest: true },
] as const;

export type QualityStep = (typeof STEPS)[number];

/** Finds the quality step that a device can draw fast enough from the times between its repaints. */
export class QualitySteps {
  #step = 0;
  #intervals: number[] = [];
  #calmMs = 0;
  #neededMs = FIRST_CALM_MS;
  #sinceUpMs = Number.POSITIVE_INFINITY;
  #hopelessWindows = 0;

  /** Whether even the lowest step is far too slow. */
  get hopeless(): boolean {
    return this.#hopelessWindows >= HOPELESS_WINDOWS;
  }

  get step(): QualityStep {
    return STEPS[this.#step]!;
  }

  /** Takes the time between two repaints, ms, during all of which something moved. True when `step` or `hopeless`
   *  changed. */
  recordRepaint(intervalMs: number): boolean {
    if (intervalMs > PAUSE_MS) return false;
    this.#sinceUpMs += intervalMs;
    this.#intervals.push(intervalMs);
    const spanMs = this.#intervals.reduce((sum, ms) => sum + ms, 0);
    const { length } = this.#intervals;
    if (length < FEWEST || (length < WINDOW && spanMs < LONG_ENOUGH_MS)) return false;
    const window = this.#intervals.sort((a, b) => a - b);
    const typicalMs = window[Math.floor(length / 2)]!;
    this.#intervals = [];
    const before = this.hopeless;
    const lost = typicalMs > HOPELESS_MS && this.#step === STEPS.length - 1;
    this.#hopelessWindows = lost ? this.#hopelessWindows + 1 : 0;
    if (typicalMs > SLOW_MS) return this.#down(typicalMs > VERY_SLOW_MS ? 2 : 1) || this.hopeless !== before;
    this.#calmMs = typicalMs < CALM_MS ? this.#calmMs + spanMs : 0;
    return this.#calmMs >= this.#neededMs && this.#up();
  }

  /** Forgets all measurements and returns to full quality. */
  reset(): void {
    this.#step = 0;
    this.#intervals = [];
    this.#calmMs = 0;
    this.#neededMs = FIRST_CALM_MS;
    this.#sinceUpMs = Number.POSITIVE_INFINITY;
    this.#hopelessWindows = 0;
  }

  #down(steps: number): boolean {
    this.#calmMs = 0;
    if (this.#step === STEPS.length - 1) return false;
    if (this.#sinceUpMs < FIRST_CALM_MS) this.#neededMs = Math.min(LONGEST_CALM_MS, 2 * this.#neededMs);
    this.#sinceUpMs = Number.POSITIVE_INFINITY;
    this.#step = Math.min(STEPS.length - 1, this.#step + steps);
    return true;
  }

  #up(): boolean {
    this.#calmMs = 0;
    if (this.#step === 0) return false;
    this.#step -= 1;
    this.#sinceUpMs = 0;
    return true;
  }
}
