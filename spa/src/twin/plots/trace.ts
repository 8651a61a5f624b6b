import type { Schema } from '@posecast/wire';
import { numberOf } from '../joints.ts';
import { isolated } from '../names.ts';
import { SensorTable, type SensorWords } from '../sensors/sensors.ts';
import type { ChannelReader } from '../values.ts';
import { valueAt } from '../values.ts';
import type { History } from './history.ts';

/** A value to plot over time: a channel, a joint's `error` (ref − pos), or a roll, pitch or yaw angle of an IMU. */
export interface Trace {
  readonly field: string;
  readonly label: string;
}

/** How a trace is read from a robot's frames, with its title and unit. */
export interface TraceReading {
  /** "RKN pos", "right foot Fz" */
  readonly title: string;
  readonly unit: string;
  /** The value of one code (the resolution), in the unit. */
  readonly scale: number;
  readonly read: ChannelReader;
  /** Whether the title is a joint's name and a field's name. */
  readonly ofJoint: boolean;
}

/** Traces that the page computes from the robot's readings. */
export interface DerivedTraces {
  /** A reader for such a trace from a history; null: it is not one of these. */
  reading(trace: Trace): TraceReading | null;
  /** Computes part of the last minute; true if there is more to compute. */
  update(history: History, nowMs: number): boolean;
}

/** A reader for a trace with this schema; null if the robot reports no such value, or only bits. `words`: for the base and
 *  power. */
export function traceReading(
  schema: Schema,
  { field: name, label }: Trace,
  words?: SensorWords,
): TraceReading | null {
  const main = schema.field('pos') ?? schema.field('ref');
  const title = `${isolated(label)} ${name}`;
  const computed = numberOf(name)?.computed;
  if (computed !== undefined) {
    const [of, minus] = [schema.field(computed.of), schema.field(computed.minus)];
    const index = minus?.labels.indexOf(label) ?? -1;
    if (of === null || minus === null || index < 0 || of.labelSet !== minus.labelSet) return null;
    const read: ChannelReader = (codes) => {
      const [whole, less] = [valueAt(codes, of, index), valueAt(codes, minus, index)];
      return whole === null || less === null ? null : whole - less;
    };
    const unit = schema.mapping.unit(minus.name, label) ?? minus.unit;
    return { title, unit, scale: minus.scale, read, ofJoint: true };
  }
  const field = schema.field(name);
  if (field !== null && field.labelSet === main?.labelSet && field.bits.length === 0) {
    const index = field.labels.indexOf(label);
    if (index < 0) return null;
    const unit = schema.mapping.unit(name, label) ?? field.unit;
    return { title, unit, scale: field.scale, read: (codes) => valueAt(codes, field, index), ofJoint: true };
  }
  const sensors = new SensorTable(schema, words);
  const found = sensors.reader(name, label);
  if (found === null) return null;
  const group = sensors.groups.find(({ readings }) => readings.includes(found.reading));
  const { unit, scale, name: short } = found.reading;
  return { title: `${group?.title ?? ''} ${short}`.trim(), unit, scale, read: found.read, ofJoint: false };
}
