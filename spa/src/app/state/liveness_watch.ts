import { countSleep, nowMs } from '../../stream/clock.ts';
import { isClaim, judge, newestAgeMs, STALE_AFTER_MS, type Verdict, type Word } from '../../twin/liveness.ts';
import type { RobotTwin } from '../../twin/robot.ts';

const EVERY_MS = 100;
/** A longer pause between two looks means that the page itself was held up. */
const HELD_UP_MS = 400;
/** Then the messages that piled up meanwhile are let in first. */
const CATCH_UP_MS = 50;

/** Judges the evidence ten times a second, because silence causes no event; notifies when the word changes. */
export class LivenessWatch {
  word: Word | null = null;
  readonly #twin: RobotTwin;
  readonly #onSlept: () => void;
  readonly #listeners = new Set<() => void>();
  readonly #leave: () => void;
  #timer: ReturnType<typeof setTimeout>;
  #lookedMs = nowMs();
  #caughtUp = true;
  /** Held up for so long that what is on the screen is old, whatever the word there says. */
  #lost = false;
  #sleptMs = countSleep();

  /** @param onSlept hears when the device has slept */
  constructor(twin: RobotTwin, onSlept: () => void) {
    this.#twin = twin;
    this.#onSlept = onSlept;
    this.#timer = setTimeout(this.#look, EVERY_MS);
    this.#leave = twin.onChange(() => this.#tell());
  }

  /** As of the last look, so that a page that was busy blames nobody else for its own delay. */
  verdict(): Verdict {
    const verdict = judge(this.#twin.evidence, this.#lookedMs);
    return this.#lost ? { ...verdict, word: null, cause: null, overShare: false } : verdict;
  }

  readonly onWord = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

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
    // The moment in which the pose gets too old is not waited past.
    const leftMs = STALE_AFTER_MS - (newestAgeMs(this.#twin.evidence, now) ?? 0);
    const nextMs = leftMs > 0 ? Math.min(EVERY_MS, leftMs) : EVERY_MS;
    this.#timer = setTimeout(this.#look, heldUp ? CATCH_UP_MS : nextMs);
    if (!heldUp) this.#lookedMs = now;
    else if (!this.#lost) return;
    this.#tell();
  };

  #tell(): void {
    const { word } = this.verdict();
    if (word === this.word) return;
    if (isClaim(this.word) && word !== null && !isClaim(word))
      this.#twin.evidence.otherwiseMs = this.#lookedMs;
    this.word = word;
    for (const listener of this.#listeners) listener();
  }
}
