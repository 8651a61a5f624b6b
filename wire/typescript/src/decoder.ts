/** Decodes frames to codes. A frame that can't be decoded leaves the decoder unchanged. */

import { BadFrame, BaseUnknown, frameId, HEADER_BYTES, KEY_HEADER_BYTES, parseHeader } from './frame.ts';
import { CODE_MAX, MISSING, type Schema } from './schema.ts';
import { parseSchema } from './schema_parser.ts';

const KEY_ORDER = 4;
const ALL_ZERO = 15;

/** One decoded frame. `tS`: robot clock, s; `codes`: all channels in the schema's order, the caller's own. */
export class Frame {
  constructor(
    readonly schema: Schema,
    readonly seq: number,
    readonly tS: number,
    readonly codes: Int32Array,
  ) {}

  /** One field in its unit, null where there is no reading. RangeError when the schema lacks it. */
  values(name: string): (number | null)[] {
    const field = this.schema.field(name);
    if (!field) throw new RangeError(`no field '${name}'`);
    return field.labels.map((_, i) => field.value(this.codes[field.start + i]!));
  }
}

interface Key {
  readonly id: number;
  readonly schema: Schema;
  readonly seq: number;
  readonly tS: number;
  readonly codes: Int32Array;
  readonly orders: Uint8Array;
}

/** Keeps the newest `maxSchemas` schemas and the newest KEY; forgets what is older. */
export class Decoder {
  private readonly schemas = new Map<number, Schema>();
  private key: Key | null = null;
  private readonly body = new BitReader();

  constructor(private readonly maxSchemas = 4) {}

  /** Learn a schema from its exact text. SchemaError when it is none. */
  addSchema(text: string): Schema {
    const schema = parseSchema(text);
    this.schemas.delete(schema.id);
    this.schemas.set(schema.id, schema);
    if (this.schemas.size > this.maxSchemas) this.schemas.delete(this.schemas.keys().next().value!);
    return schema;
  }

  /** The state a frame carries. Throws BadFrame, or BaseUnknown when its schema or base is not here. */
  decode(frame: Uint8Array): Frame {
    const header = parseHeader(frame);
    if (header.isKey) {
      const schema = this.schemas.get(header.schemaId);
      if (!schema) throw new BaseUnknown(`schema ${hex(header.schemaId)} is not here`);
      checkSize(frame, schema.keyBytesMax);
      this.body.open(frame, KEY_HEADER_BYTES);
      const keyOrders = new Uint8Array(schema.size).fill(KEY_ORDER);
      const codes = this.body.codes(schema, new Int32Array(schema.size), keyOrders);
      const orders = new Uint8Array(schema.size);
      for (let i = 0; i < orders.length; i++) orders[i] = this.body.nibble();
      this.body.close();
      const { seq, t: tS } = header;
      this.key = { id: frameId(frame), schema, seq, tS, codes: codes.slice(), orders };
      return new Frame(schema, seq, tS, codes);
    }
    const { key } = this;
    if (key?.id !== header.baseId) throw new BaseUnknown(`base ${hex(header.baseId)} is not here`);
    checkSize(frame, key.schema.frameBytesMax);
    this.body.open(frame, HEADER_BYTES);
    const codes = this.body.codes(key.schema, key.codes, key.orders);
    this.body.close();
    return new Frame(key.schema, (key.seq + header.distance) >>> 0, key.tS + header.ms / 1000, codes);
  }
}

function checkSize(frame: Uint8Array, bytesMax: number): void {
  if (frame.length > bytesMax)
    throw new BadFrame(`frame of ${frame.length} bytes, ${bytesMax} allowed by its schema`);
}

/** Reads a body bit by bit, highest bit first, out of a buffer that ends in zeros so that it may look ahead. */
class BitReader {
  private bytes = new Uint8Array(1024);
  private at = 0;
  private end = 0; // both in bits

  open(frame: Uint8Array, offset: number): void {
    const size = frame.length - offset;
    if (this.bytes.length < size + 8) this.bytes = new Uint8Array(2 * size + 8);
    this.bytes.set(offset ? frame.subarray(offset) : frame);
    this.bytes.fill(0, size, size + 8);
    this.at = 0;
    this.end = 8 * size;
  }

  nibble(): number {
    const { at, bytes } = this;
    this.at += 4;
    if (this.at > this.end) throw new BadFrame('the body ends too early');
    const two = (bytes[at >> 3]! << 8) | bytes[(at >> 3) + 1]!;
    return (two >> (12 - (at & 7))) & 15;
  }

  close(): void {
    if (this.end - this.at >= 8 || this.peek32(this.at) !== 0)
      throw new BadFrame('more than zero padding after the last code');
  }

  codes(schema: Schema, base: Int32Array, orders: Uint8Array): Int32Array {
    const codes = new Int32Array(schema.size);
    for (const { start, size, rel } of schema.fields) {
      const n = this.nibble();
      const partner = rel === null ? -1 : schema.field(rel)!.start - start;
      for (let i = start; i < start + size; i++) {
        let moved = n === ALL_ZERO ? 0 : this.residual(Math.min(15, Math.max(0, orders[i]! + n - 4)));
        if (rel !== null) moved += codes[i + partner]! - base[i + partner]!;
        const code = base[i]! + moved;
        if (code < MISSING || code > CODE_MAX) throw new BadFrame('a code past the range');
        codes[i] = code;
      }
    }
    return codes;
  }

  /** One exp-Golomb code of order k, signed. It takes 63 bits at most, read in two looks of 32. */
  private residual(k: number): number {
    const zeros = Math.clz32(this.peek32(this.at));
    const size = zeros + 1 + k;
    const first = this.at + zeros;
    this.at = first + size;
    if (this.at > this.end || size > 32) throw new BadFrame('no residual: past the end or the range');
    const z = (this.peek32(first) >>> (32 - size)) - (1 << k); // below 2^32, so not an int32
    return z & 1 ? -(z + 1) / 2 : z / 2;
  }

  private peek32(at: number): number {
    const { bytes } = this;
    const i = at >> 3;
    const shift = at & 7;
    const four = (bytes[i]! << 24) | (bytes[i + 1]! << 16) | (bytes[i + 2]! << 8) | bytes[i + 3]!;
    return (four << shift) | (bytes[i + 4]! >> (8 - shift));
  }
}

function hex(id: number): string {
  return id.toString(16).padStart(8, '0');
}
