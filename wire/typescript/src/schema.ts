/** The schema of a stream: its channels, their order, and the unit and scale of their codes. */

import { Mapping } from './mapping.ts';

/** The code of "no reading". */
export const MISSING = -(2 ** 28);
/** Readings lie in -CODE_MAX … CODE_MAX. */
export const CODE_MAX = 2 ** 28 - 1;

/** Channels `start` … `start + size - 1` of the code vector; value = code × scale, in `unit`. */
export class Field {
  readonly size: number;

  constructor(
    readonly name: string,
    readonly labels: readonly string[],
    readonly labelSet: string,
    readonly unit: string,
    readonly scale: number,
    /** The earlier field whose movement this one shares. */
    readonly rel: string | null,
    /** Names, lowest bit first; empty for a number. */
    readonly bits: readonly string[],
    readonly slow: boolean,
    readonly start: number,
  ) {
    this.size = labels.length;
  }

  /** The value of one code, null where there is no reading. */
  value(code: number): number | null {
    return code === MISSING ? null : code * this.scale;
  }

  /** Names of the bits set in one code of a `bits` field; a bit without a name reads `bit N`. */
  bitsSet(code: number): string[] {
    const set: string[] = [];
    if (code !== MISSING)
      for (let i = 0; code >> i; i++) if ((code >> i) & 1) set.push(this.bits[i] ?? `bit ${i}`);
    return set;
  }
}

/** A schema as `parseSchema` reads it. `text` is the exact text received; `id` its FNV-1a-32, which KEY frames name. */
export class Schema {
  private readonly byName: ReadonlyMap<string, Field>;

  constructor(
    readonly text: string,
    readonly id: number,
    readonly robot: string,
    readonly fields: readonly Field[],
    readonly size: number,
    readonly mapping: Mapping,
  ) {
    this.byName = new Map(fields.map((f) => [f.name, f]));
  }

  /** No KEY of this schema is longer (SPEC §4): a code takes 63 bits at most, its order 4. */
  get keyBytesMax(): number {
    return 17 + Math.ceil((4 * this.fields.length + 67 * this.size) / 8);
  }

  /** Likewise of a plain frame. */
  get frameBytesMax(): number {
    return 9 + Math.ceil((4 * this.fields.length + 63 * this.size) / 8);
  }

  field(name: string): Field | null {
    return this.byName.get(name) ?? null;
  }
}

/** A schema that has come through `postMessage`, which takes the classes off: gives them back, in place. */
export function revived(schema: Schema): Schema {
  for (const field of schema.fields) Object.setPrototypeOf(field, Field.prototype);
  Object.setPrototypeOf(schema.mapping, Mapping.prototype);
  return Object.setPrototypeOf(schema, Schema.prototype) as Schema;
}
