const WINDOW_MS = 2000;
/** Frames that arrive within less than this are a burst, and their rate means nothing. */
const BURST_MS = 250;

/** Measures the frame rate over the last two seconds. Frames may arrive in bursts, if a proxy holds them back. */
export class RateMeter {
  #arrivals: number[] = [];

  /** Counts a frame that has just arrived. */
  recordArrival(nowMs: number): void {
    this.#arrivals.push(nowMs);
  }

  /** Frames per second; 0 if fewer than two frames, or only a burst, are known. */
  hz(nowMs: number): number {
    this.#arrivals = this.#arrivals.filter((atMs) => nowMs - atMs <= 2 * WINDOW_MS);
    const within = this.#arrivals.findIndex((atMs) => nowMs - atMs <= WINDOW_MS);
    if (within < 0) return 0;
    // from the last frame before, because all frames of the two seconds may be one burst
    const counted = this.#arrivals.slice(Math.max(0, within - 1));
    const spanMs = counted.at(-1)! - counted[0]!;
    return spanMs < BURST_MS ? 0 : ((counted.length - 1) * 1000) / spanMs;
  }
}
