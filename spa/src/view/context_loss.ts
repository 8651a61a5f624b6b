/** So many losses within `WITHIN_MS` are taken as bad luck; one more, and this browser can't hold a context. */
export const MOST_LOSSES = 3;
export const WITHIN_MS = 120_000;
/** A browser that means to give a context back does so sooner. */
export const PATIENCE_MS = 8000;

/** Counts how often the browser has taken the WebGL context away, and says when waiting for it makes no more sense. */
export class ContextLossPolicy {
  #times: number[] = []; // at most MOST_LOSSES + 1

  /** Counts one loss. False when there were more than `MOST_LOSSES` within `WITHIN_MS`: then 3D is given up. */
  recordLoss(nowMs: number): boolean {
    this.#times = [...this.#times.filter((ms) => nowMs - ms < WITHIN_MS), nowMs].slice(-MOST_LOSSES - 1);
    return this.#times.length <= MOST_LOSSES;
  }
}
