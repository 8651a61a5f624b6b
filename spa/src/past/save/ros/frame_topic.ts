import { type Field, MISSING, type Schema } from '@posecast/wire';
import { factorOf, type Quantity } from '../../../twin/si_units.ts';
import type { CdrWriter } from './cdr_writer.ts';
import type { MessageType } from './definitions.ts';
import { writeHeader } from './stamp.ts';

/** Gain · channel. `channel`: its index in the code vector; null for a channel that is in no frame. */
export interface Term {
  readonly channel: number | null;
  readonly gain: number;
}

/** A number in a message: Σ gain · channel + offset; NaN if a channel has no reading. */
export interface Reading {
  readonly terms: readonly Term[];
  readonly offset: number;
}

/** A topic of frames. */
export interface FrameTopic {
  readonly name: string;
  readonly type: MessageType;
  /** Channels that can be recovered from its messages, because a number of the message has only that channel. */
  readonly carried: ReadonlySet<number>;
  /** For channels written as reported: the extra metadata of the MCAP channel. */
  readonly units: ReadonlyMap<string, string>;
  /** Writes a frame's message. `atUs`: unix; `values`: of all channels (`valuesOf`). */
  write(to: CdrWriter, atUs: number, values: Float64Array): void;
}

export const NO_READING: Reading = { terms: [{ channel: null, gain: 1 }], offset: 0 };
export const NO_UNITS: ReadonlyMap<string, string> = new Map();

/** Writes what follows the header of a message. */
export type WriteBody = (to: CdrWriter, values: Float64Array) => void;

/** A topic whose messages begin with a header. The header names a link; with empty bytes it names none. */
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

/** Writes the value of each channel in its own unit, NaN if there is no reading. */
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

/** A channel in SI units; nothing if it does not exist or its unit does not measure this quantity. */
export function readingOf(schema: Schema, field: Field, label: string, quantity: Quantity): Reading {
  const gain = channelFactor(schema, field, label, quantity);
  return gain === null ? NO_READING : { terms: [{ channel: placeOf(field, label), gain }], offset: 0 };
}

/** The factor that converts a channel to SI; null if it does not exist or its unit does not measure this quantity. */
export function channelFactor(
  schema: Schema,
  field: Field,
  label: string,
  quantity: Quantity,
): number | null {
  if (field.bits.length > 0 || !field.labels.includes(label)) return null;
  return factorOf(quantity, schema.mapping.unit(field.name, label) ?? field.unit);
}

/** A channel's index in the code vector. */
export function placeOf(field: Field, label: string): number | null {
  const at = field.labels.indexOf(label);
  return at < 0 ? null : field.start + at;
}

/** Null if no number uses a channel. */
export function unlessEmpty(readings: readonly Reading[]): readonly Reading[] | null {
  return readings.some(({ terms }) => terms.some(({ channel }) => channel !== null)) ? readings : null;
}
