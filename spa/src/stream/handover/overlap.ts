/** What names a frame where its run is not told. */
interface FrameMark {
  readonly seq: number;
  readonly tS: number;
}

/** Passes over the frame that a socket tells when it begins, where a lane or another transport has shown it before. */
export class Overlap {
  #shown: FrameMark | null = null;

  /** `shown`: the newest frame that was shown. */
  begin(shown: FrameMark | null): void {
    this.#shown = shown;
  }

  /** Whether a frame was shown before. The first one that was not ends it. */
  isShown({ seq, tS }: FrameMark): boolean {
    if (seq === this.#shown?.seq && tS === this.#shown.tS) return true;
    this.#shown = null;
    return false;
  }
}
