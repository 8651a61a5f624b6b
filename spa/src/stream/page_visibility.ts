/**
 * Whether this page can be seen: its tab is in front and, where it is embedded in another page, its frame is scrolled into view.
 * A hidden page requests no poses from the relay.
 */
export class PageVisibility {
  #onScreen = true;
  #seen: boolean;
  readonly #tell: (seen: boolean) => void;
  readonly #leave = new AbortController();

  /** `tell` is called at every change, but not for the first value (see `visible`). */
  constructor(tell: (seen: boolean) => void) {
    this.#tell = tell;
    this.#seen = !document.hidden;
    const { signal } = this.#leave;
    document.addEventListener('visibilitychange', this.#look, { signal });
    if (typeof IntersectionObserver === 'undefined') return;
    // Without an explicit root, it observes the viewport of the outermost page, even from inside an iframe.
    const observer = new IntersectionObserver((entries) => {
      this.#onScreen = entries.at(-1)?.isIntersecting ?? true;
      this.#look();
    });
    observer.observe(document.documentElement);
    signal.addEventListener('abort', () => observer.disconnect());
  }

  get visible(): boolean {
    return this.#seen;
  }

  close(): void {
    this.#leave.abort();
  }

  readonly #look = (): void => {
    const seen = !document.hidden && this.#onScreen;
    if (seen === this.#seen) return;
    this.#seen = seen;
    this.#tell(seen);
  };
}
