import { Emitter } from '../../kit.ts';
import type { PastControls } from '../../past/past_types.ts';
import { isOld, type Verdict } from '../../twin/liveness.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import type { Watch } from '../state/liveness_watch.ts';
import { pastWords } from '../words/moment.ts';

/** The longest segment; until a segment is loaded, its first pose stands for all of it. */
const NEAR_MS = 7000;
/** If a part is missing, the previous pose is shown for no longer than this, ms. */
const GAP_NEAR_MS = 500;
const WAS = { online: null, silent: 'STALE', offline: 'OFFLINE' } as const;
type ThenWord = keyof typeof WAS;

/** Reports PAST, or RECORDED for a recording, and the robot's state at the shown moment. */
export class PastWatch implements Watch {
  readonly word: 'PAST' | 'RECORDED';
  readonly #twin: RobotTwin;
  readonly #momentMs: () => number;
  readonly #past: () => Pick<PastControls, 'playhead' | 'nowMs'>;
  readonly #changed = new Emitter();
  #was: (typeof WAS)[ThenWord] = null;
  #isOld = true; // nothing is loaded yet

  /** `momentMs`: the moment of this picture. `past` is published less often, and everything derived from it must agree. */
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

  /** Notifies listeners if the shown pose has become out of date, or is current again. */
  look(): void {
    const isOldNow = isOld(this.verdict());
    if (isOldNow === this.#isOld) return;
    this.#isOld = isOldNow;
    this.#changed.emit();
  }

  readonly onWord = this.#changed.on;

  verdict(): Verdict {
    const momentMs = this.#momentMs();
    const { state } = this.#twin;
    const { playhead, nowMs } = this.#past();
    const nearMs = (playhead.recorded?.gap(momentMs) ?? null) === null ? NEAR_MS : GAP_NEAR_MS;
    const isHere = state !== null && (this.#was !== null || Math.abs(state.atMs - momentMs) < nearMs);
    // the past pose stays until a live one arrives
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
