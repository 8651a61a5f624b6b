/** Does one thing `ms` after the newest `restart`, unless it is cancelled before. */
export class Debounce {
  readonly #ms: number;
  readonly #what: () => void;
  #timer: ReturnType<typeof setTimeout> | null = null;

  constructor(ms: number, what: () => void) {
    this.#ms = ms;
    this.#what = what;
  }

  /** Whether it is going to be done. */
  get pending(): boolean {
    return this.#timer !== null;
  }

  /** Waits the whole time again, from now on. */
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
