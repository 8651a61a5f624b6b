import { BalanceReader } from '../../model/balance/balance_reader.ts';
import type { Balance } from '../../twin/balance/balance.ts';
import { MARGIN } from '../../twin/balance/stance.ts';
import { DerivedHistory, type History } from '../../twin/plots/history.ts';
import type { DerivedTraces, Trace, TraceReading } from '../../twin/plots/trace.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { type BalanceText, balanceText } from '../text/balance.ts';
import { type BalanceWatch, balanceOf } from './balance_watch.ts';

/** A balance number that can be listed and plotted. */
interface BalanceValue {
  readonly field: string;
  readonly label: string;
  readonly name: keyof BalanceText & ('margin' | 'massX' | 'massY' | 'massZ' | 'pressureX' | 'pressureY');
  readonly unit: 'mm' | 'm';
  /** The key of its explanation. */
  readonly explain: string;
}

const { field } = MARGIN;

/** The balance numbers, in the order `writeValues` uses. */
export const VALUES: readonly BalanceValue[] = [
  { ...MARGIN, name: 'margin', unit: 'mm', explain: 'balance.margin' },
  { field, label: 'mass.x', name: 'massX', unit: 'm', explain: 'balance.mass' },
  { field, label: 'mass.y', name: 'massY', unit: 'm', explain: 'balance.mass' },
  { field, label: 'mass.z', name: 'massZ', unit: 'm', explain: 'balance.mass' },
  { field, label: 'pressure.x', name: 'pressureX', unit: 'm', explain: 'balance.pressure' },
  { field, label: 'pressure.y', name: 'pressureY', unit: 'm', explain: 'balance.pressure' },
];

/** Writes the numbers of one balance result: the margin in mm, the rest in metres in world coordinates; NaN where unknown. */
export function writeValues({ marginM, centreOfMass, pressure }: Balance, into: Float64Array): void {
  into[0] = marginM === null ? Number.NaN : marginM * 1000;
  for (let i = 0; i < 3; i += 1) into[1 + i] = centreOfMass?.[i] ?? Number.NaN;
  for (let i = 0; i < 2; i += 1) into[4 + i] = pressure?.[i] ?? Number.NaN;
}

/** The display resolution, in each value's unit. */
const SCALE = { mm: 0.1, m: 0.001 } as const;

/** The last minute of a robot's balance, for plots. Computed from the raw codes in its history, a few at a time. */
class BalanceTraces implements DerivedTraces {
  readonly #watch: BalanceWatch;
  #madeFor: BalanceReader | null = null;
  #history: DerivedHistory | null = null;

  constructor(watch: BalanceWatch) {
    this.#watch = watch;
  }

  reading({ field, label }: Trace): TraceReading | null {
    const column = VALUES.findIndex((value) => value.field === field && value.label === label);
    const value = VALUES[column];
    if (value === undefined) return null;
    const text = balanceText();
    return {
      title: `${text.balance}: ${text[value.name]}`,
      unit: value.unit,
      scale: SCALE[value.unit],
      read: (_codes, atMs = Number.NaN) => this.#history?.value(column, atMs) ?? null,
      ofJoint: false,
    };
  }

  update(history: History, nowMs: number): boolean {
    const shown = this.#watch.reader;
    if (shown === null) return false;
    const { manifest, schema } = shown;
    if (manifest !== this.#madeFor?.manifest || schema !== this.#madeFor.schema) {
      this.#madeFor = shown;
      // A separate reader, because the watch's reader moves on with the newest frames.
      const reader = new BalanceReader(manifest, schema);
      this.#history = new DerivedHistory(schema, VALUES.length, (codes, atMs, into) =>
        writeValues(reader.ofFrame(codes, atMs / 1000), into),
      );
    }
    return this.#history?.update(history, nowMs) ?? false;
  }
}

const kept = new WeakMap<RobotTwin, BalanceTraces>();

/** The traces of a robot's balance. */
export function balanceTraces(link: Pick<RobotLink, 'twin' | 'manifestUrl'>): DerivedTraces {
  const traces = kept.get(link.twin) ?? new BalanceTraces(balanceOf(link));
  kept.set(link.twin, traces);
  return traces;
}
