import type { Field, Schema } from '@posecast/wire';
import { SensorTable } from '../sensors/sensors.ts';
import { type ChannelReader, valueAt } from '../values.ts';
import type { History } from './history.ts';
import type { Trace } from './trace.ts';

/** Of the first traces, how many are joint positions, and how many are the other values that move most. */
const FIRST = { positions: 4, others: 2 } as const;
/** A value that has changed by at most this much, in steps of its resolution, counts as still. */
const NOISE_STEPS = 2;
/** Maximum number of channels whose motion is compared, and of sensor values. */
const MOST_COMPARED = 2000;

/** One page of traces: as many as fit below one another and can be told apart. */
export const TRACES_A_PAGE = FIRST.positions + FIRST.others;

interface Channel extends Trace {
  readonly scale: number;
  readonly read: ChannelReader;
}

/**
 * Everything that can be plotted, in a useful default order: first the joints and other values that have moved most in the last
 * minute, then the rest, field by field in the robot's order.
 */
export function arrangeTraces(history: History, nowMs: number): Trace[] {
  const { schema } = history;
  if (schema === null) return [];
  const [main = [], ...others] = channelsOf(schema);
  const motion = motionsOf(history, [main, ...others].flat().slice(0, MOST_COMPARED), nowMs);
  const moving = others.map((channels) => channels.filter((one) => (motion.get(one) ?? 0) > NOISE_STEPS));
  const beside = moving.find((channels) => channels.length > 0) ?? [];
  const first = [...mostMoving(main, motion, FIRST.positions), ...mostMoving(beside, motion, FIRST.others)];
  const chosen = new Set(first);
  const rest = [main, ...others].flat().filter((one) => !chosen.has(one));
  return [...first, ...rest].map(({ field, label }) => ({ field, label }));
}

/** The numeric channels, by field: joint positions first, commands last among the joint fields. */
function channelsOf(schema: Schema): Channel[][] {
  const main = schema.field('pos') ?? schema.field('ref');
  const rank = ({ name }: Field) => (name === main?.name ? 0 : name === 'ref' ? 2 : 1);
  const ofJoints = schema.fields
    .filter(({ labelSet, bits }) => labelSet === main?.labelSet && bits.length === 0)
    .sort((a, b) => rank(a) - rank(b))
    .map((field) =>
      field.labels.map((label, index) => ({
        ...{ field: field.name, label, scale: field.scale },
        read: (codes: Int32Array) => valueAt(codes, field, index),
      })),
    );
  const jointFields = new Set(ofJoints.flatMap((channels) => channels.map(({ field }) => field)));
  const sensors = new SensorTable(schema);
  let left = MOST_COMPARED; // finding a reader takes time in proportion to their number
  const ofSensors = sensors.groups.map(({ readings }) => {
    const own = readings.filter(({ field }) => !jointFields.has(field)).slice(0, left);
    left -= own.length;
    return own.map(({ field, label, scale }) => {
      return { field, label, scale, read: sensors.reader(field, label)!.read };
    });
  });
  return [...ofJoints, ...ofSensors].filter((channels) => channels.length > 0);
}

/** How far each channel has moved in the last minute, in steps of its resolution. */
function motionsOf(history: History, channels: readonly Channel[], nowMs: number): Map<Channel, number> {
  const { columns } = history.window(
    channels.map(({ read }) => read),
    nowMs,
  );
  return new Map(
    channels.map((channel, i) => {
      let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
      for (const value of columns[i] ?? []) {
        if (value === null) continue;
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
      return [channel, high > low ? (high - low) / channel.scale : 0];
    }),
  );
}

/** The `count` channels that move most, in their own order. */
function mostMoving(
  channels: readonly Channel[],
  motion: ReadonlyMap<Channel, number>,
  count: number,
): Channel[] {
  const ranked = [...channels].sort((a, b) => (motion.get(b) ?? 0) - (motion.get(a) ?? 0));
  const chosen = new Set(ranked.slice(0, count));
  return channels.filter((one) => chosen.has(one));
}
