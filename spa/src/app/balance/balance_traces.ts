import { BalanceReader } from '../../model/balance/balance_reader.ts';
import { DerivedHistory } from '../../twin/plots/derived_history.ts';
import type { History } from '../../twin/plots/history.ts';
import type { DerivedTraces, Trace, TraceReading } from '../../twin/plots/trace.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { balanceText } from '../text/balance.ts';
import { VALUES, writeValues } from './balance_values.ts';
import { type BalanceWatch, balanceOf } from './balance_watch.ts';

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
