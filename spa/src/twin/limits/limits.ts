import type { Mapping, Threshold } from '@posecast/wire';

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
