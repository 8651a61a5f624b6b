/** A picture that takes longer counts as slow. */
const TOO_LONG_MS = 26;
/** A picture that takes less leaves time for more pixels. */
const SHORT_MS = 7;
/** This many slow pictures in a row lower the resolution; a single one may be an outlier. */
const LONG_IN_A_ROW = 4;
const SHORT_IN_A_ROW = 30;
/** Pixels per CSS pixel, along each side. */
const STEPS = [0.5, 0.75, 1, 1.5, 2] as const;
const USUAL = STEPS.indexOf(1);

/** Adapts the resolution of moving pictures to the drawing time of recent ones. Pictures at rest may take longer. */
export class AdaptiveResolution {
  #step = USUAL;
  #long = 0;
  #short = 0;

  /** The pixels per CSS pixel to draw with. `screen`: device pixels per CSS pixel. */
  ratio(screen: number, resting: boolean): number {
    // At rest, twice the screen's pixels are drawn, up to 2 per CSS pixel, which smooths edges.
    return resting ? Math.max(1, Math.min(2, screen * 2)) : Math.min(STEPS[this.#step]!, 2);
  }

  /** Whether motion is drawn with fewer pixels than usual. */
  get reduced(): boolean {
    return this.#step < USUAL;
  }

  took(ms: number): void {
    this.#long = ms > TOO_LONG_MS ? this.#long + 1 : 0;
    this.#short = ms < SHORT_MS ? this.#short + 1 : 0;
    if (this.#long === LONG_IN_A_ROW) this.#go(-1);
    else if (this.#short === SHORT_IN_A_ROW) this.#go(1);
  }

  #go(steps: number): void {
    this.#step = Math.min(STEPS.length - 1, Math.max(0, this.#step + steps));
    this.#long = this.#short = 0;
  }
}
