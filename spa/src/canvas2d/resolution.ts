/** Longer than this a picture may not take, or it is drawn with fewer pixels. */
const TOO_LONG_MS = 26;
/** So short that more pixels would do, too. */
const SHORT_MS = 7;
/** One long picture is an accident. */
const LONG_IN_A_ROW = 4;
const SHORT_IN_A_ROW = 30;
/** Pixels for each of CSS, along each side. */
const STEPS = [0.5, 0.75, 1, 1.5, 2] as const;
const USUAL = STEPS.indexOf(1);

/** How many pixels a picture in motion is made of, by how long the last ones took. One at rest may take its time. */
export class AdaptiveResolution {
  #step = USUAL;
  #long = 0;
  #short = 0;

  /** `screen`: device pixels for each of CSS. */
  ratio(screen: number, resting: boolean): number {
    // At rest twice as many as the screen has, up to 2: then edges are smooth.
    return resting ? Math.max(1, Math.min(2, screen * 2)) : Math.min(STEPS[this.#step]!, 2);
  }

  /** Whether motion is shown with fewer pixels than usual. */
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
