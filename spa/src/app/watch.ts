import { nowMs } from '../stream/clock.ts';
import { judge, type Verdict, type Word } from '../twin/liveness.ts';
import type { RobotTwin } from '../twin/robot.ts';

const EVERY_MS = 100;

/** Looks at the evidence ten times a second, and tells when the word changes: nothing else would, since silence makes
 *  no noise. */
export class LivenessWatch {
  word: Word | null = null;
  readonly #twin: RobotTwin;
  readonly #listeners = new Set<() => void>();
  readonly #timer: ReturnType<typeof setInterval>;
  readonly #leave: () => void;

  constructor(twin: RobotTwin) {
    this.#twin = twin;
    this.#timer = setInterval(() => this.#look(), EVERY_MS);
    this.#leave = twin.onChange(() => this.#look());
  }

  verdict(): Verdict {
    return judge(this.#twin.evidence, nowMs());
  }

  readonly onWord = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  close(): void {
    clearInterval(this.#timer);
    this.#leave();
  }

  #look(): void {
    const { word } = this.verdict();
    if (word === this.word) return;
    this.word = word;
    for (const listener of this.#listeners) listener();
  }
}
