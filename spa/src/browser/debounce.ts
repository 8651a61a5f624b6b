/** One thing that will be done after a while, unless it is put off or called off before. */
export class Debounce {
  readonly #ms: number;
  readonly #what: () => void;
  #timer: ReturnType<typeof setTimeout> | null = null;

  constructor(ms: number, what: () => void) {
    this.#ms = ms;
    this.#what = what;
  }

  /** Whether it is still to be done. */
  get pending(): boolean {
    return this.#timer !== null;
  }

  /** From now on the whole while again. */
  restart(): void {
    this.cancel();
    this.#timer = setTimeout(() => {
      this.#timer = null;
      this.#what();
    }, this.#ms);
  }

  cancel(): void {
    if (this.#timer !== null) clearTimeout(this.#timer);
    this.#timer = null;
  }
}
