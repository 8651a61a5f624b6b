import type { Level, Threshold } from '@posecast/wire';
import { displayOf } from '../format.ts';
import type { ValueLimits } from '../limits/limits.ts';
import type { SensorGroup } from '../sensors/sensors.ts';

/** A reading that passed a limit set by the viewer (`on`), or came back within it (`off`). */
export interface Crossing {
  readonly n: number;
  /** Unix, ms, by the viewer's clock. */
  readonly atMs: number;
  /** "right foot Fz" */
  readonly source: string;
  /** The side on which `limit`, a text with its unit ("300 N"), was passed. */
  readonly side: 'above' | 'below';
  readonly limit: string;
  readonly state: 'on' | 'off';
}

type Past = Pick<Crossing, 'side' | 'limit'>;

/** Most crossings kept; the oldest are dropped. */
export const CROSSING_LIMIT = 100;

/** Records when readings pass the viewer's own limits. The edge sends events only for the limits of the profile. */
export class LimitLog {
  /** Newest last. */
  crossings: readonly Crossing[] = [];
  readonly #past = new Map<string, { level: Level; past: Past }>();
  #next = 1;

  /** Takes the readings of a new frame (`atMs`: Unix ms). True when crossings were added. */
  look(groups: readonly SensorGroup[], limits: ValueLimits, atMs: number): boolean {
    const { length } = this.crossings;
    const last = this.crossings.at(-1);
    for (const { title, readings } of groups) {
      for (const { field, label, name, unit, value, level } of readings) {
        const key = `${field}\n${label}`; // no name holds a control character
        const threshold = limits.edited(field, label) ? limits.threshold(field, label) : null;
        const before = this.#past.get(key);
        if (threshold === null) {
          this.#past.delete(key);
          continue;
        }
        const source = `${title} ${name}`;
        if (level === 'fault' && before?.level !== 'fault' && value !== null) {
          const past = pastOf(threshold, value, unit);
          this.#past.set(key, { level, past });
          this.#add({ atMs, source, ...past, state: 'on' });
        } else if (level !== 'fault' && before?.level === 'fault' && value !== null) {
          this.#past.delete(key);
          this.#add({ atMs, source, ...before.past, state: 'off' });
        }
      }
    }
    return this.crossings.length !== length || this.crossings.at(-1) !== last;
  }

  #add(crossing: Omit<Crossing, 'n'>): void {
    this.crossings = [...this.crossings, { n: this.#next, ...crossing }].slice(-CROSSING_LIMIT);
    this.#next += 1;
  }
}

function pastOf({ low, high }: Threshold, value: number, unit: string): Past {
  const below = low !== null && value < low;
  const limit = `${below ? low : high} ${displayOf(unit, 'rad').unit}`.trim();
  return { side: below ? 'below' : 'above', limit };
}
