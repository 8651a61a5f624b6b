import type { JointRow } from '../../../twin/joints.ts';

/** A row stays on top this long after its fault, even if acknowledged, because rows that jump can't be read. */
const STAYS_ON_TOP_MS = 5000;
/** Only a caution that lasts this long moves a row up, because a walking robot's joints briefly lag now and then. */
const CAUTION_LASTS_MS = 1000;

/** Flag: the row has a fault that is not acknowledged. */
const OPEN = 4;
const LEVELS: readonly JointRow['level'][] = ['ok', 'caution', 'fault'];

/** Ranks the rows of a table. It is called for each row at each update, so its data is in typed arrays. */
export class Ranks {
  /** 0: normal, 1: caution, 2: fault; plus the OPEN flag. */
  readonly #levels: Uint8Array;
  readonly #faultMs: Float64Array;
  readonly #cautionMs: Float64Array;
  readonly #cautionSinceMs: Float64Array;

  constructor(rows: number) {
    const never = () => new Float64Array(rows).fill(Number.NEGATIVE_INFINITY);
    this.#levels = new Uint8Array(rows);
    this.#faultMs = never();
    this.#cautionMs = never();
    this.#cautionSinceMs = never();
  }

  set(i: number, level: JointRow['level'], open: boolean): void {
    this.#levels[i] = LEVELS.indexOf(level) | (open ? OPEN : 0);
  }

  /** 2: a fault now or until just now; 1: caution; 0: normal. */
  of(i: number, nowMs: number): 0 | 1 | 2 {
    const held = this.#levels[i]!;
    const level = held & ~OPEN;
    if (level === 2) this.#faultMs[i] = nowMs;
    else if (level === 1) {
      if (nowMs - this.#cautionMs[i]! > STAYS_ON_TOP_MS) this.#cautionSinceMs[i] = nowMs;
      this.#cautionMs[i] = nowMs;
    }
    if (held !== level || nowMs - this.#faultMs[i]! < STAYS_ON_TOP_MS) return 2;
    const lasted = this.#cautionMs[i]! - this.#cautionSinceMs[i]! >= CAUTION_LASTS_MS;
    return lasted && nowMs - this.#cautionMs[i]! < STAYS_ON_TOP_MS ? 1 : 0;
  }
}
