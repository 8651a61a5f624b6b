import { nowMs } from '../stream/clock.ts';
import { judge, newestAgeMs, STALE_AFTER_MS, type Verdict, type Word } from '../twin/liveness.ts';
import type { RobotTwin } from '../twin/robot.ts';

const EVERY_MS = 100;
/** A longer pause between two looks means that the page itself was held up. */
const HELD_UP_MS = 400;
/** Then the messages that piled up meanwhile are let in first. */
const CATCH_UP_MS = 50;

/** Looks at the evidence ten times a second, and tells when the word changes: nothing else would, since silence makes
 *  no noise. */
export class LivenessWatch {
  word: Word | null = null;
  readonly #twin: RobotTwin;
  readonly #listeners = new Set<() => void>();
  readonly #leave: () => void;
  #timer: ReturnType<typeof setTimeout>;
  #lookedMs = nowMs();
  #caughtUp = true;

  constructor(twin: RobotTwin) {
    this.#twin = twin;
    this.#timer = setTimeout(this.#look, EVERY_MS);
    this.#leave = twin.onChange(() => this.#tell());
  }

  /** As of the last look, so that a page that was busy blames nobody else for its own delay. */
  verdict(): Verdict {
    return judge(this.#twin.evidence, this.#lookedMs);
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
    const now = nowMs();
    const heldUp = this.#caughtUp && now - this.#lookedMs > HELD_UP_MS;
    this.#caughtUp = !heldUp;
    // The moment in which the pose gets too old is not waited past.
    const leftMs = STALE_AFTER_MS - (newestAgeMs(this.#twin.evidence, now) ?? 0);
    const nextMs = leftMs > 0 ? Math.min(EVERY_MS, leftMs) : EVERY_MS;
    this.#timer = setTimeout(this.#look, heldUp ? CATCH_UP_MS : nextMs);
    if (heldUp) return;
    this.#lookedMs = now;
    this.#tell();
  };

  #tell(): void {
    const { word } = this.verdict();
    if (word === this.word) return;
    this.word = word;
    for (const listener of this.#listeners) listener();
  }
}
