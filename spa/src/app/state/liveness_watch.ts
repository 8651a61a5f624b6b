import { Emitter } from '../../kit.ts';
import { countSleep, nowMs } from '../../stream/clock.ts';
import {
  HELD_UP_MS,
  isClaim,
  judge,
  newestAgeMs,
  STALE_AFTER_MS,
  type Verdict,
  type Word,
} from '../../twin/liveness.ts';
import type { RobotTwin } from '../../twin/robot.ts';

const EVERY_MS = 100;
/** After such a pause, the time for processing the messages that arrived meanwhile, before the next check. */
const CATCH_UP_MS = 50;

/** Reports in one word whether the page shows a robot's present state. */
export interface Watch {
  /** The newest verdict. */
  verdict(): Verdict;
  /** Its word; null while nothing is known. */
  readonly word: Word | null;
  /** Adds a listener for changes of the word or its cause. Returns a function that removes it. */
  readonly onWord: (listener: () => void) => () => void;
}

/** Judges a robot's evidence at least ten times a second, because no event tells that messages have stopped. Notifies listeners
 *  when the word or its cause changes. Chip, banner and body all use the verdict of the last check, so that they never disagree. */
export class LivenessWatch implements Watch {
  readonly #twin: RobotTwin;
  readonly #onSlept: () => void;
  readonly #onDoubt: (sinceMs: number) => void;
  readonly #changed = new Emitter();
  readonly #leave: () => void;
  #verdict: Verdict;
  #timer: ReturnType<typeof setTimeout>;
  #lookedMs = nowMs();
  #caughtUp = true;
  /** The page was blocked for so long that the shown pose is old; this is reported until messages have been processed. */
  #lost = false;
  #sleptMs = countSleep();

  /**
   * @param onSlept is called when the device has slept.
   * @param onDoubt is called when the shown pose is no longer called live, with the time (ms).
   */
  constructor(twin: RobotTwin, onSlept: () => void, onDoubt: (sinceMs: number) => void) {
    this.#twin = twin;
    this.#onSlept = onSlept;
    this.#onDoubt = onDoubt;
    this.#verdict = judge(twin.evidence, this.#lookedMs);
    this.#timer = setTimeout(this.#look, EVERY_MS);
    this.#leave = twin.onChange(() => this.#tell());
  }

  /** The verdict as of the last check. It is not as of now, so that a delay of the busy page itself does not make the
   *  robot look stale. */
  verdict(): Verdict {
    return this.#verdict;
  }

  /** The word of the last verdict; null while nothing is known. */
  get word(): Word | null {
    return this.#verdict.word;
  }

  /** Adds a listener for changes of the word or its cause. Returns a function that removes it. */
  readonly onWord = this.#changed.on;

  /** Stops the checks. */
  close(): void {
    clearTimeout(this.#timer);
    this.#leave();
  }

  readonly #look = (): void => {
    const slept = countSleep();
    if (slept !== this.#sleptMs) {
      this.#sleptMs = slept;
      this.#onSlept();
    }
    const now = nowMs();
    const heldUpMs = now - this.#lookedMs;
    const heldUp = this.#caughtUp && heldUpMs > HELD_UP_MS;
    this.#caughtUp = !heldUp;
    this.#lost = heldUp && heldUpMs > STALE_AFTER_MS;
    if (heldUp) this.#twin.acceptHoldUp(this.#lookedMs, now);
    // The next check is no later than the moment at which the pose becomes too old.
    const leftMs = STALE_AFTER_MS - (newestAgeMs(this.#twin.evidence, now) ?? 0);
    const nextMs = leftMs > 0 ? Math.min(EVERY_MS, leftMs) : EVERY_MS;
    this.#timer = setTimeout(this.#look, heldUp ? CATCH_UP_MS : nextMs);
    if (!heldUp) this.#lookedMs = now;
    else if (!this.#lost) return;
    this.#tell();
  };

  #tell(): void {
    const { word: before, cause: causeBefore } = this.#verdict;
    const verdict = judge(this.#twin.evidence, this.#lookedMs);
    const claims = this.#lost && isClaim(verdict.word); // a state called old may be called so all the time
    const sinceMs = nowMs() - this.#lookedMs;
    // the page may have been blocked since the last check, and a pose that is called old has aged all the time
    const ageMs = verdict.ageMs === null ? null : verdict.ageMs + sinceMs;
    const isBusy = this.#twin.evidence.holdUps.explain(this.#lookedMs, nowMs());
    if (claims)
      this.#verdict = {
        ...verdict,
        word: 'STALE',
        cause: isBusy ? 'busy browser' : null,
        overShare: false,
        ageMs,
      };
    else this.#verdict = verdict.word === 'STALE' ? { ...verdict, ageMs } : verdict;
    const { word, cause } = this.#verdict;
    if (word === before && cause === causeBefore) return;
    if (isClaim(before) && word !== null && !isClaim(word) && !claims) {
      this.#twin.evidence.otherwiseMs = this.#lookedMs;
      this.#onDoubt(this.#lookedMs);
    }
    this.#changed.emit();
  }
}
