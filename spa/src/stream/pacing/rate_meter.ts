const WINDOW_MS = 2000;

/** Measures the frame rate over the last two seconds. */
export class RateMeter {
  #arrivals: number[] = [];

  /** Counts a frame that has just arrived. */
  recordArrival(nowMs: number): void {
    this.#arrivals.push(nowMs);
  }

  /** Frames per second; 0 with fewer than two frames. */
  hz(nowMs: number): number {
    this.#arrivals = this.#arrivals.filter((atMs) => nowMs - atMs <= WINDOW_MS);
    const [first] = this.#arrivals;
    const last = this.#arrivals.at(-1);
    if (first === undefined || last === undefined || last <= first) return 0;
    return ((this.#arrivals.length - 1) * 1000) / (last - first);
  }
}
