/** Of a picture's height: more of it under notes and buttons is the person's own doing. */
const MOST_COVERED = 0.4;
const EASE_SECONDS = 0.25;

/** What stands over a picture's upper and lower edge, CSS px: what is looked at stands between them. */
export interface Insets {
  readonly above: number;
  readonly below: number;
}

/** The part of a picture that nothing stands over. A new size counts at once; what comes to cover it pushes gently. CSS px. */
export class ViewInsets {
  width = 1;
  height = 1;
  #from: Insets = NONE;
  #to: Insets = NONE;
  /** Of the way from one cover to the other. */
  #part = 1;

  resize(width: number, height: number): void {
    this.width = width;
    this.height = height;
  }

  /** True when this covers more or less than before. */
  setInsets(cover: Insets, eased: boolean): boolean {
    if (cover.above === this.#to.above && cover.below === this.#to.below) return false;
    this.#from = this.#cover;
    this.#to = cover;
    this.#part = eased ? 0 : 1;
    return true;
  }

  /** On its way to another cover. */
  get moving(): boolean {
    return this.#part < 1;
  }

  /** Moves on by so many seconds. */
  advance(seconds: number): void {
    this.#part = Math.min(1, this.#part + seconds / EASE_SECONDS);
  }

  /** From the picture's upper edge to where nothing covers it. */
  get top(): number {
    return this.#fitting(this.#cover).above;
  }

  /** How high it is. */
  get free(): number {
    return this.#freeOf(this.#cover);
  }

  /** Width : height, as they will be when all has come to rest. */
  get aspect(): number {
    return this.width / this.#freeOf(this.#to);
  }

  get #cover(): Insets {
    const mix = (from: number, to: number) => to + (from - to) * (1 - this.#part) ** 2;
    return {
      above: mix(this.#from.above, this.#to.above),
      below: mix(this.#from.below, this.#to.below),
    };
  }

  #freeOf(cover: Insets): number {
    const { above, below } = this.#fitting(cover);
    return this.height - above - below;
  }

  #fitting({ above, below }: Insets): Insets {
    const part = Math.min(1, (this.height * MOST_COVERED) / Math.max(1, above + below));
    return { above: above * part, below: below * part };
  }
}

const NONE: Insets = { above: 0, below: 0 };
