const WINDOW_MS = 2000;

/** How often frames come, measured over two seconds. */
export class RateMeter {
  #arrivals: number[] = [];

  /** Counts a frame that came now. */
  recordArrival(nowMs: number): void {
    this.#arrivals.push(nowMs);
  }

  /** Frames a second; 0 while there are fewer than two. */
  hz(nowMs: number): number {
    this.#arrivals = this.#arrivals.filter((atMs) => nowMs - atMs <= WINDOW_MS);
    const [first] = this.#arrivals;
    const last = this.#arrivals.at(-1);
    if (first === undefined || last === undefined || last <= first) return 0;
    return ((this.#arrivals.length - 1) * 1000) / (last - first);
  }
}
