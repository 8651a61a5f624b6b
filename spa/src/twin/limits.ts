import { type Level, level, type Mapping, type Threshold } from '@posecast/wire';

/** As a fraction of the limit: how far inside it a value must be before the level falls. The edge uses the same for its
 *  events.
 */
const HYSTERESIS = 0.05;

const RANK: Readonly<Record<Level, number>> = { ok: 0, caution: 1, fault: 2 };

export function worseOf(a: Level, b: Level): Level {
  return RANK[a] >= RANK[b] ? a : b;
}

/** The level of one channel, with hysteresis against flicker: it rises at once and falls only when the value is well
 *  back. */
export class LevelLatch {
  #held: Level = 'ok';
  #threshold: Threshold | null = null;

  /** The level of the newest value; no limits and no reading are `ok`. */
  next(threshold: Threshold | null, value: number | null): Level {
    if (threshold !== this.#threshold) this.#held = 'ok'; // the held level belongs to the previous limit
    this.#threshold = threshold;
    if (threshold === null || value === null || Number.isNaN(value)) {
      this.#held = 'ok';
      return 'ok';
    }
    const now = level(threshold, value);
    if (RANK[now] >= RANK[this.#held]) this.#held = now;
    else {
      const lingering = levelFurtherOut(threshold, value);
      if (RANK[lingering] < RANK[this.#held]) this.#held = lingering;
    }
    return this.#held;
  }
}

/** The worse of the levels that the value would have if it were a margin higher (against `high`) or lower (against
 *  `low`). */
function levelFurtherOut({ low, high, caution }: Threshold, value: number): Level {
  const above = level({ low: null, high, caution }, value + HYSTERESIS * Math.abs(high ?? 0));
  const below = level({ low, high: null, caution }, value - HYSTERESIS * Math.abs(low ?? 0));
  return worseOf(above, below);
}

export type { Threshold };

/** Thresholds that a viewer has set: field → label → threshold. They take precedence over those of the profile. */
export type ThresholdEdits = ReadonlyMap<string, ReadonlyMap<string, Threshold>>;

export const NO_EDITS: ThresholdEdits = new Map();

/** Maximum edits read from storage: as many as a robot may have channels. */
const EDITS_MAX = 4096;
/** The label that stands for all channels of a field, as in a profile. */
export const ANY = '*';

/** The limits in effect on this page: the viewer's own, else the profile's. */
export class ValueLimits {
  readonly #mapping: Mapping;
  readonly #edits: ThresholdEdits;

  constructor(mapping: Mapping, edits: ThresholdEdits = NO_EDITS) {
    this.#mapping = mapping;
    this.#edits = edits;
  }

  /** The profile's limits, whatever the viewer has set. */
  profile(field: string, label: string): Threshold | null {
    return this.#mapping.threshold(field, label);
  }

  threshold(field: string, label: string): Threshold | null {
    const mine = this.#edits.get(field);
    return mine?.get(label) ?? mine?.get(ANY) ?? this.profile(field, label);
  }

  edited(field: string, label: string): boolean {
    return this.#edits.get(field)?.has(label) ?? false;
  }
}

/** `edits` with one channel's threshold set; null restores the profile's. */
export function withEdit(
  edits: ThresholdEdits,
  field: string,
  label: string,
  threshold: Threshold | null,
): ThresholdEdits {
  const next = new Map(edits);
  const ofField = new Map(next.get(field));
  if (threshold === null) ofField.delete(label);
  else ofField.set(label, threshold);
  if (ofField.size === 0) next.delete(field);
  else next.set(field, ofField);
  return next;
}

/** Why limits that the viewer typed are invalid. The value is the key of the explanation. */
export type BadThreshold = 'limitNoNumber' | 'limitMissing' | 'limitsCrossed' | 'limitCaution';

/** Checks a threshold; null if it is valid. */
export function whyNoThreshold({ low, high, caution }: Threshold): BadThreshold | null {
  for (const limit of [low, high]) if (limit !== null && !Number.isFinite(limit)) return 'limitNoNumber';
  if (low === null && high === null) return 'limitMissing';
  if (low !== null && high !== null && low >= high) return 'limitsCrossed';
  return caution > 0 && caution <= 1 ? null : 'limitCaution';
}

/** Serialises edits to JSON for the browser's storage. */
export function editsText(edits: ThresholdEdits): string {
  return JSON.stringify(Object.fromEntries([...edits].map(([field, of]) => [field, Object.fromEntries(of)])));
}

/** Reads edits from stored JSON. Never throws: invalid text or entries are left out. */
export function readEdits(text: string | null): ThresholdEdits {
  let stored: unknown = null;
  try {
    stored = JSON.parse(text ?? 'null');
  } catch {
    // treated like nothing stored
  }
  let edits = NO_EDITS;
  let left = EDITS_MAX;
  for (const [field, of] of entries(stored)) {
    for (const [label, value] of entries(of)) {
      const threshold = readThreshold(value);
      if (threshold === null || left === 0) continue;
      edits = withEdit(edits, field, label, threshold);
      left -= 1;
    }
  }
  return edits;
}

function entries(value: unknown): [string, unknown][] {
  return typeof value === 'object' && value !== null ? Object.entries(value) : [];
}

function readThreshold(value: unknown): Threshold | null {
  if (typeof value !== 'object' || value === null) return null;
  const { low = null, high = null, caution = 1 } = value as Record<string, unknown>;
  const isLimit = (limit: unknown): limit is number | null => limit === null || typeof limit === 'number';
  if (!isLimit(low) || !isLimit(high) || typeof caution !== 'number') return null;
  const threshold = { low, high, caution };
  return whyNoThreshold(threshold) === null ? threshold : null;
}

/** The texts for a range in the viewer's language. */
interface RangeWords {
  readonly atMost: (value: string) => string;
  readonly atLeast: (value: string) => string;
  readonly between: (low: string, high: string) => string;
}

/** A threshold in words: "±5 A", "−30 N to 500 N", "at most 70 °C". `shown` formats a value with its unit. */
export function rangeWords(
  { low, high }: Threshold,
  shown: (value: number) => string,
  words: RangeWords,
): string {
  if (low === null) return words.atMost(shown(high ?? 0));
  if (high === null) return words.atLeast(shown(low));
  return -low === high ? `±${shown(high)}` : words.between(shown(low), shown(high));
}

/** The remaining range of a joint. */
export interface LimitMargin {
  /** To the nearer limit, rad or m; negative beyond it. */
  readonly left: number;
  readonly nearer: 'lower' | 'upper';
  /** The same as a fraction of half the range: 1 in the middle, 0 at a limit, negative beyond it. */
  readonly part: number;
}

/** The distance of a joint (rad or m) from its nearer limit. null without a reading, for a joint without limits, and if they
 *  leave no range, as in URDF's `lower="0" upper="0"`. */
export function limitMargin(
  value: number | null,
  limits: { readonly lower: number; readonly upper: number } | null,
): LimitMargin | null {
  if (value === null || !Number.isFinite(value) || limits === null || !(limits.upper > limits.lower))
    return null;
  const [below, above] = [value - limits.lower, limits.upper - value];
  const left = Math.min(below, above);
  const part = left / ((limits.upper - limits.lower) / 2);
  return { left, nearer: below <= above ? 'lower' : 'upper', part };
}
