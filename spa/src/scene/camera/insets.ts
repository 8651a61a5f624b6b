/** The most that counts as covered, as a fraction of the picture's height. */
const MOST_COVERED = 0.4;
const EASE_SECONDS = 0.25;

/** How far notes and buttons cover a picture from its top and bottom edge, CSS px. */
export interface Insets {
  readonly above: number;
  readonly below: number;
}

/** The uncovered part of a picture, CSS px. A new size applies at once; new insets may be eased. */
export class ViewInsets {
  width = 1;
  height = 1;
  #from: Insets = NONE;
  #to: Insets = NONE;
  /** Progress (0…1) of the easing from `#from` to `#to`. */
  #part = 1;

  resize(width: number, height: number): void {
    this.width = width;
    this.height = height;
  }

  /** Sets how much is covered, at once or eased over a quarter of a second. True if that is a change. */
  setInsets(cover: Insets, eased: boolean): boolean {
    if (cover.above === this.#to.above && cover.below === this.#to.below) return false;
    this.#from = this.#cover;
    this.#to = cover;
    this.#part = eased ? 0 : 1;
    return true;
  }

  /** Whether the free part is still easing towards the newest insets. */
  get moving(): boolean {
    return this.#part < 1;
  }

  /** Advances the easing. */
  advance(seconds: number): void {
    this.#part = Math.min(1, this.#part + seconds / EASE_SECONDS);
  }

  /** The top of the free part, CSS px below the picture's top edge. */
  get top(): number {
    return this.#fitting(this.#cover).above;
  }

  /** The height of the free part, CSS px. */
  get free(): number {
    return this.#freeOf(this.#cover);
  }

  /** The height of the free part at the end of the easing, CSS px. */
  get finalFree(): number {
    return this.#freeOf(this.#to);
  }

  /** Width : height of the free part at the end of the easing. */
  get aspect(): number {
    return this.width / this.finalFree;
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
