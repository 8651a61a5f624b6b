import type { Schema } from '@posecast/wire';
import { isolated } from '../names.ts';
import { type PowerWords, SensorTable } from '../sensors/sensors.ts';
import type { ChannelReader } from '../values.ts';
import { valueAt } from '../values.ts';

/** What a person wants to see over time: a channel, a joint's `error` (ref − pos), or an angle of an attitude. */
export interface Trace {
  readonly field: string;
  readonly label: string;
}

/** How it is read from this robot's frames, and what it is called. */
export interface TraceReading {
  /** "RKN pos", "right foot Fz" */
  readonly title: string;
  readonly unit: string;
  /** Value of one code, in the unit. */
  readonly scale: number;
  readonly read: ChannelReader;
  /** Whether the title is a joint's name and the field's. */
  readonly ofJoint: boolean;
}

/** null when the robot reports no such value, or one that is no number. `power`: what power is called. */
export function traceReading(
  schema: Schema,
  { field: name, label }: Trace,
  power?: PowerWords,
): TraceReading | null {
  const main = schema.field('pos') ?? schema.field('ref');
  const title = `${isolated(label)} ${name}`;
  if (name === 'error') {
    const [ref, pos] = [schema.field('ref'), schema.field('pos')];
    const index = pos?.labels.indexOf(label) ?? -1;
    if (ref === null || pos === null || index < 0 || ref.labelSet !== pos.labelSet) return null;
    const read: ChannelReader = (codes) => {
      const [told, is] = [valueAt(codes, ref, index), valueAt(codes, pos, index)];
      return told === null || is === null ? null : told - is;
    };
    return {
      title,
      unit: schema.mapping.unit('pos', label) ?? pos.unit,
      scale: pos.scale,
      read,
      ofJoint: true,
    };
  }
  const field = schema.field(name);
  if (field !== null && field.labelSet === main?.labelSet && field.bits.length === 0) {
    const index = field.labels.indexOf(label);
    if (index < 0) return null;
    const unit = schema.mapping.unit(name, label) ?? field.unit;
    return { title, unit, scale: field.scale, read: (codes) => valueAt(codes, field, index), ofJoint: true };
  }
  const sensors = new SensorTable(schema, power);
  const found = sensors.reader(name, label);
  if (found === null) return null;
  const group = sensors.groups.find(({ readings }) => readings.includes(found.reading));
  const { unit, scale, name: short } = found.reading;
  return { title: `${group?.title ?? ''} ${short}`.trim(), unit, scale, read: found.read, ofJoint: false };
}
