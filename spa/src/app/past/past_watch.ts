import type { PastControls } from '../../past/past_types.ts';
import { isOld, type Verdict } from '../../twin/liveness.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import type { Watch } from '../state/liveness_watch.ts';
import { pastWords } from '../status/past_words.ts';

/** No segment is longer, and the first pose of one stands for all of it at first. */
const NEAR_MS = 7000;
/** Where a part is missing, a pose of before stands for no more than this, ms. */
const GAP_NEAR_MS = 500;
const WAS = { online: null, silent: 'STALE', offline: 'OFFLINE' } as const;
type ThenWord = keyof typeof WAS;

/** Says PAST, or RECORDED of a recording, and what the robot was then. */
export class PastWatch implements Watch {
  readonly word: 'PAST' | 'RECORDED';
  readonly #twin: RobotTwin;
  readonly #momentMs: () => number;
  readonly #past: () => Pick<PastControls, 'playhead' | 'nowMs'>;
  readonly #listeners = new Set<() => void>();
  #was: (typeof WAS)[ThenWord] = null;
  #isOld = true; // nothing is here yet

  /** `momentMs`: the shown moment of this picture; `past` is told less often, and what is told of it must agree. */
  constructor(
    twin: RobotTwin,
    momentMs: () => number,
    past: () => Pick<PastControls, 'playhead' | 'nowMs'>,
    word: 'PAST' | 'RECORDED' = 'PAST',
  ) {
    this.word = word;
    this.#twin = twin;
    this.#momentMs = momentMs;
    this.#past = past;
  }

  was(word: ThenWord): void {
    this.#was = WAS[word];
    this.look();
  }

  /** Tells whoever listens if the shown pose has become old, or is no longer. */
  look(): void {
    const isOldNow = isOld(this.verdict());
    if (isOldNow === this.#isOld) return;
    this.#isOld = isOldNow;
    for (const listener of this.#listeners) listener();
  }

  readonly onWord = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  verdict(): Verdict {
    const momentMs = this.#momentMs();
    const { state } = this.#twin;
    const { playhead, nowMs } = this.#past();
    const nearMs = (playhead.recorded?.gap(momentMs) ?? null) === null ? NEAR_MS : GAP_NEAR_MS;
    const isHere = state !== null && (this.#was !== null || Math.abs(state.atMs - momentMs) < nearMs);
    // the pose of then is shown until a live one is here
    const toldMs = playhead.at === 'past' ? playhead.momentMs : momentMs;
    const askedMs = playhead.note === 'not-kept' ? playhead.askedMs : null;
    return {
      word: this.word,
      cause: null,
      overShare: false,
      ageMs: playhead.recorded === null ? Math.max(0, nowMs - toldMs) : null,
      linkMs: null,
      unchangedMs: null,
      past: {
        momentMs: toldMs,
        askedMs,
        was: this.#was,
        isHere,
        recorded: playhead.recorded,
        words: pastWords,
      },
    };
  }
}
