/** This many losses within `WITHIN_MS` are tolerated; after one more, this browser is assumed unable to hold a context. */
export const MOST_LOSSES = 3;
export const WITHIN_MS = 120_000;
/** How long to wait for the context: a browser that gives it back at all does so sooner. */
export const PATIENCE_MS = 8000;

/** Counts how often the browser took the WebGL context away, and decides when to stop waiting for it. */
export class ContextLossPolicy {
  #times: number[] = []; // at most MOST_LOSSES + 1

  /** Counts one loss. False if there were more than `MOST_LOSSES` within `WITHIN_MS`: 3D is then given up. */
  recordLoss(nowMs: number): boolean {
    this.#times = [...this.#times.filter((ms) => nowMs - ms < WITHIN_MS), nowMs].slice(-MOST_LOSSES - 1);
    return this.#times.length <= MOST_LOSSES;
  }
}
