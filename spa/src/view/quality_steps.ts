/**
 * What a slow device gives up, and when it has it back. From repaint to repaint of a picture in motion goes in; what to
 * do without comes out. Pure.
 *
 * One step down when half of the newest repaints took too long. One step up only after a long calm; if that was too
 * early, the next calm must be twice as long. So it does not swing.
 */

/** Fewer than 20 pictures a second look slow, and leave a pose of each second unseen. */
export const SLOW_MS = 50;
/** With this much to spare the next better step is worth a try. */
export const CALM_MS = 24;
export const WINDOW = 10;
/** Of repaints that take very long fewer are waited for: as soon as so many have taken so long. */
export const FEWEST = 5;
export const LONG_ENOUGH_MS = 3000;
export const FIRST_CALM_MS = 8000;
export const LONGEST_CALM_MS = 256_000;
/** With all given up that there is, and still fewer than ten pictures a second for so many windows: another way of drawing is
 *  wanted. */
export const HOPELESS_MS = 100;
export const HOPELESS_WINDOWS = 2;
/** Longer than this is no repaint that was slow: the page was hidden, or the machine slept. */
const PAUSE_MS = 4000;
/** Where pictures take so long, one step would not do. */
const VERY_SLOW_MS = 600;

/** From everything to the least. `pixels`: of the screen's, along each side. `shadow`: of the shadow map's, likewise.
 *  `lowest`: the coarsest shells. */
export const STEPS = [
  { pixels: 1, shadow: 1, lowest: false },
  { pixels: 0.75, shadow: 0.5, lowest: false },
  { pixels: 0.5, shadow: 0.25, lowest: false },
  { pixels: 0.5, shadow: 0.25, lowest: true },
  { pixels: 0.35, shadow: 0.125, lowest: true },
] as const;

export type QualityStep = (typeof STEPS)[number];

/** The step of quality that a device can draw fast enough, found from the times between its repaints. */
export class QualitySteps {
  #step = 0;
  #intervals: number[] = [];
  #calmMs = 0;
  #neededMs = FIRST_CALM_MS;
  #sinceUpMs = Number.POSITIVE_INFINITY;
  #hopelessWindows = 0;

  /** Whether there is nothing left to give up, and it does not suffice. */
  get hopeless(): boolean {
    return this.#hopelessWindows >= HOPELESS_WINDOWS;
  }

  get step(): QualityStep {
    return STEPS[this.#step]!;
  }

  /** Takes the time from one repaint to the next, while something moved all that time. True when the step changed,
   *  or when it proved hopeless. */
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
