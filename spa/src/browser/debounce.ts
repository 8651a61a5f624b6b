/** Calls a function `ms` after the last `restart`, unless it is cancelled first. */
export class Debounce {
  readonly #ms: number;
  readonly #what: () => void;
  #timer: ReturnType<typeof setTimeout> | null = null;

  constructor(ms: number, what: () => void) {
    this.#ms = ms;
    this.#what = what;
  }

  /** Whether a call is pending. */
  get pending(): boolean {
    return this.#timer !== null;
  }

  /** Restarts the waiting time. */
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
