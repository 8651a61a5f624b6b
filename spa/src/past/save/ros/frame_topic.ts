import { type Field, MISSING, type Schema } from '@posecast/wire';
import { factorOf, type Quantity } from '../../../twin/si_units.ts';
import type { CdrWriter } from './cdr_writer.ts';
import type { MessageType } from './definitions.ts';
import { writeHeader } from './stamp.ts';

/** Gain · channel. `channel`: its place in the code vector; null for one that no frame has. */
export interface Term {
  readonly channel: number | null;
  readonly gain: number;
}

/** A number of a message: Σ gain · channel + offset; NaN where a channel has no reading. */
export interface Reading {
  readonly terms: readonly Term[];
  readonly offset: number;
}

/** A topic of frames. */
export interface FrameTopic {
  readonly name: string;
  readonly type: MessageType;
  /** Channels that can be told from its messages: those that are a number of them by themselves. */
  readonly carried: ReadonlySet<number>;
  /** Of channels that are as the robot reports them: what the channel of the file says beside. */
  readonly units: ReadonlyMap<string, string>;
  /** Writes a frame's message. `atUs`: unix; `values`: of all channels (`valuesOf`). */
  write(to: CdrWriter, atUs: number, values: Float64Array): void;
}

export const NO_READING: Reading = { terms: [{ channel: null, gain: 1 }], offset: 0 };
export const NO_UNITS: ReadonlyMap<string, string> = new Map();

/** Writes what follows the header of a message. */
export type WriteBody = (to: CdrWriter, values: Float64Array) => void;

/** A topic whose messages begin with a header that names a link, or with no bytes none. */
export function stampedTopic(
  name: string,
  type: MessageType,
  link: Uint8Array,
  carried: ReadonlySet<number>,
  writeBody: WriteBody,
): FrameTopic {
  return {
    ...{ name, type, carried, units: NO_UNITS },
    write: (to, atUs, values) => {
      to.begin();
      writeHeader(to, atUs, link);
      writeBody(to, values);
    },
  };
}

/** Writes the value of each channel in its own unit, NaN where there is no reading. */
export function valuesOf(schema: Schema, codes: Int32Array, into: Float64Array): void {
  for (const { start, size, scale } of schema.fields)
    for (let i = start; i < start + size; i++)
      into[i] = codes[i] === MISSING ? Number.NaN : codes[i]! * scale;
}

export function compute({ terms, offset }: Reading, values: Float64Array): number {
  let total = offset;
  for (const { channel, gain } of terms) total += channel === null ? Number.NaN : gain * values[channel]!;
  return total;
}

export function carriedBy(readings: readonly Reading[]): Set<number> {
  return new Set(
    readings.flatMap(({ terms: [first, ...more] }) =>
      first === undefined || more.length > 0 || first.gain === 0 ? [] : (first.channel ?? []),
    ),
  );
}

/** A channel in SI; nothing when there is none, or when its unit is none of this quantity. */
export function readingOf(schema: Schema, field: Field, label: string, quantity: Quantity): Reading {
  const gain = channelFactor(schema, field, label, quantity);
  return gain === null ? NO_READING : { terms: [{ channel: placeOf(field, label), gain }], offset: 0 };
}

/** By what a channel is multiplied to be in SI; null when there is none, or its unit is none of this quantity. */
export function channelFactor(
  schema: Schema,
  field: Field,
  label: string,
  quantity: Quantity,
): number | null {
  if (field.bits.length > 0 || !field.labels.includes(label)) return null;
  return factorOf(quantity, schema.mapping.unit(field.name, label) ?? field.unit);
}

/** A channel's place in the code vector. */
export function placeOf(field: Field, label: string): number | null {
  const at = field.labels.indexOf(label);
  return at < 0 ? null : field.start + at;
}

/** Null where no number has a channel. */
export function unlessEmpty(readings: readonly Reading[]): readonly Reading[] | null {
  return readings.some(({ terms }) => terms.some(({ channel }) => channel !== null)) ? readings : null;
}
