import type { Level, Threshold } from '@posecast/wire';
import { displayOf } from '../format.ts';
import type { ValueLimits } from '../limits.ts';
import type { Reading, SensorGroup } from '../sensors/sensors.ts';

/** A reading that exceeded a limit watched only by this page (`on`), or returned within it (`off`). */
export interface Crossing {
  readonly n: number;
  /** Unix, ms, by the viewer's clock. */
  readonly atMs: number;
  /** "right foot Fz" */
  readonly source: string;
  /** The side on which `limit`, a text with its unit ("300 N"), was exceeded. */
  readonly side: 'above' | 'below';
  readonly limit: string;
  readonly state: 'on' | 'off';
  /** Whether the viewer set the limit. */
  readonly own: boolean;
}

type Past = Pick<Crossing, 'side' | 'limit' | 'own'>;
type Noted = Pick<Reading, 'field' | 'label' | 'name' | 'unit' | 'value' | 'level'>;

/** Maximum number of crossings kept; the oldest are dropped. */
export const CROSSING_LIMIT = 100;

/** Records when readings exceed limits that only this page watches: the viewer's own, and those of values that the page computes.
 *  The edge sends events for the others. */
export class LimitLog {
  /** Newest last. */
  crossings: readonly Crossing[] = [];
  readonly #past = new Map<string, { level: Level; past: Past }>();
  /** By reading, the limit that it was last compared with since `begin`; null: the log has not been restarted. */
  #judgedBy: Map<string, Threshold> | null = null;
  #next = 1;

  /** Drops the crossings from a moment (Unix ms) on. The following data may be from any time: a reading that is beyond its limit
   *  at the first check does not count as a crossing. */
  begin(sinceMs: number): void {
    this.crossings = this.crossings.filter(({ atMs }) => atMs < sinceMs);
    this.#past.clear();
    this.#judgedBy = new Map();
  }

  /** Takes the readings of a new frame (`atMs`: Unix ms). True if crossings were added. */
  look(groups: readonly SensorGroup[], limits: ValueLimits, atMs: number): boolean {
    const before = this.crossings;
    for (const { title, readings } of groups)
      for (const reading of readings) {
        const { field, label } = reading;
        this.note(title, reading, limits.edited(field, label) ? limits.threshold(field, label) : null, atMs);
      }
    return this.crossings !== before;
  }

  /** Takes one reading of a new frame, with its limit; null: no limit. `own`: the viewer set it. */
  note(title: string, reading: Noted, threshold: Threshold | null, atMs: number, own = true): void {
    const { field, label, name, unit, value, level } = reading;
    const key = `${field}\n${label}`; // no name holds a control character
    const before = this.#past.get(key);
    if (threshold === null) {
      this.#past.delete(key);
      return;
    }
    if (value === null) return;
    const isFirst = this.#judgedBy !== null && this.#judgedBy.get(key) !== threshold;
    this.#judgedBy?.set(key, threshold);
    const source = `${title} ${name}`;
    if (level === 'fault' && before?.level !== 'fault') {
      const past = { ...pastOf(threshold, value, unit), own };
      this.#past.set(key, { level, past });
      if (!isFirst) this.#add({ atMs, source, ...past, state: 'on' });
    } else if (level !== 'fault' && before?.level === 'fault') {
      this.#past.delete(key);
      if (!isFirst) this.#add({ atMs, source, ...before.past, state: 'off' });
    }
  }

  #add(crossing: Omit<Crossing, 'n'>): void {
    this.crossings = [...this.crossings, { n: this.#next, ...crossing }].slice(-CROSSING_LIMIT);
    this.#next += 1;
  }
}

function pastOf({ low, high }: Threshold, value: number, unit: string): Omit<Past, 'own'> {
  const below = low !== null && value < low;
  const limit = `${below ? low : high} ${displayOf(unit, 'rad').unit}`.trim();
  return { side: below ? 'below' : 'above', limit };
}
