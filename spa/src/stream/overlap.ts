/** Identifies a frame if its run is not sent. */
interface FrameMark {
  readonly seq: number;
  readonly tS: number;
}

/** The maximum lag of another relay behind the one that showed the newest frame, s; anything later is not live or belongs to
 *  another run. */
const LAG_S = 1.5;

/** Skips the first frames of a socket if a lane, another transport or another relay has already shown them or a newer one. */
export class Overlap {
  #shown: FrameMark | null = null;

  /** `shown`: the newest shown frame. */
  begin(shown: FrameMark | null): void {
    this.#shown = shown;
  }

  /** Whether this frame, or a newer one of the same run, was already shown. The first frame that was not ends the overlap. */
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
