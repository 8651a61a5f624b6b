/** What names a frame where its run is not told. */
interface FrameMark {
  readonly seq: number;
  readonly tS: number;
}

/** By so much another relay may lag behind the one that has shown the newest frame, s: what lags more is not live, or of another run. */
const LAG_S = 1.5;

/** Passes over the frames that a socket tells when it begins, where a lane, another transport or another relay has shown them
 *  before, or a newer one. */
export class Overlap {
  #shown: FrameMark | null = null;

  /** `shown`: the newest frame that was shown. */
  begin(shown: FrameMark | null): void {
    this.#shown = shown;
  }

  /** Whether this frame, or a newer one of the same run, was shown before. The first one that was not ends it. */
  isShown({ seq, tS }: FrameMark): boolean {
    const shown = this.#shown;
    if (shown !== null) {
      if (seq === shown.seq && tS === shown.tS) return true;
      if (seq < shown.seq && tS < shown.tS && shown.tS - tS < LAG_S) return true;
    }
    this.#shown = null;
    return false;
  }
}
