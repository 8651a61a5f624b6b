/** Encodes codes to frames, for replay and tests, with the same bytes as the Python encoder. */

import { frameId, HEADER_BYTES, KEY_HEADER_BYTES, TAG_KEY, TAG_PLAIN } from './frame.ts';
import { CODE_MAX, type Field, MISSING, type Schema } from './schema.ts';

const ORDER_MAX = 15; // of the exp-Golomb code
const KEY_ORDER = 4; // every channel's order in a KEY's own body
const NEW_ORDER = 3; // a channel's order before anything is known of it
const NIBBLE_MAX = 14;
const ALL_ZERO = '1111'; // the nibble of a field that did not move
const LEARNING_FRAMES = 8; // an idle robot sends as many in a KEY interval
const STEP = 1.0247924945978928; // order = round(log2(0.69 × mean z)), as thresholds on the mean

interface Base {
  readonly id: number;
  readonly seq: number;
  readonly tS: number;
  readonly codes: ArrayLike<number>;
}

/** One stream of one run. KEYs are timed by the monotonic clock passed in, never by robot time. */
export class Encoder {
  /** The newest KEY: the base of the frames after it. */
  key: Uint8Array | null = null;
  private keyNowS = 0;
  private lastTS = 0;
  private base: Base;
  private zSums: Float64Array;
  private zFrames = 0;
  private orders: Uint8Array;

  constructor(
    readonly schema: Schema,
    private readonly keyIntervalS = 4,
  ) {
    if (!(keyIntervalS > 0)) throw new RangeError(`key interval of ${keyIntervalS} s`);
    this.base = { id: 0, seq: 0, tS: 0, codes: new Int32Array(schema.size) };
    this.zSums = new Float64Array(schema.size);
    this.orders = new Uint8Array(schema.size).fill(NEW_ORDER);
  }

  /** One frame. `seq` u32, growing; `tS`: robot clock, s; `nowS`: monotonic clock, s. */
  encode(codes: ArrayLike<number>, seq: number, tS: number, nowS: number, forceKey = false): Uint8Array {
    if (codes.length !== this.schema.size)
      throw new RangeError(`${codes.length} codes for ${this.schema.size} channels`);
    for (let i = 0; i < codes.length; i++)
      if (!(codes[i]! >= MISSING && codes[i]! <= CODE_MAX)) throw new RangeError('a code past the range');
    if (!(seq >>> 0 === seq && Number.isFinite(tS)))
      throw new RangeError(`seq ${seq}, t ${tS}: no frame can carry them`);
    const distance = (seq - this.base.seq) >>> 0;
    const ms = Math.floor(Math.max(-1, Math.min(tS - this.base.tS, 66)) * 1000 + 0.5);
    const keyAge = nowS - this.keyNowS;
    const fits = ms >= 0 && ms <= 0xffff && distance > 0 && distance <= 0xffff && tS >= this.lastTS;
    const keyIsYoung = this.key !== null && keyAge >= 0 && keyAge < this.keyIntervalS;
    this.lastTS = tS;
    return fits && keyIsYoung && !forceKey
      ? this.encodePlain(codes, distance, ms)
      : this.encodeKey(codes, seq, tS, nowS);
  }

  private encodeKey(codes: ArrayLike<number>, seq: number, tS: number, nowS: number): Uint8Array {
    if (this.zFrames >= LEARNING_FRAMES) {
      this.orders = Uint8Array.from(this.zSums, (total) => orderOf(total / this.zFrames));
      this.zSums = new Float64Array(this.schema.size);
      this.zFrames = 0;
    }
    const keyOrders = new Uint8Array(this.schema.size).fill(KEY_ORDER);
    const bits = this.body(Float64Array.from(codes), keyOrders, null);
    const orders = Array.from(this.orders, (k) => binary(k, 4)).join('');
    const frame = packed(KEY_HEADER_BYTES, bits + orders);
    const view = new DataView(frame.buffer);
    view.setUint8(0, TAG_KEY);
    view.setUint32(1, this.schema.id, true);
    view.setUint32(5, seq, true);
    view.setFloat64(9, tS, true);
    this.base = { id: frameId(frame), seq, tS, codes: Int32Array.from(codes) };
    this.keyNowS = nowS;
    this.key = frame;
    return frame;
  }

  private encodePlain(codes: ArrayLike<number>, distance: number, ms: number): Uint8Array {
    const moved = Float64Array.from(codes, (code, i) => code - this.base.codes[i]!);
    const frame = packed(HEADER_BYTES, this.body(moved, this.orders, this.zSums));
    this.zFrames += 1;
    const view = new DataView(frame.buffer);
    view.setUint8(0, TAG_PLAIN);
    view.setUint32(1, this.base.id, true);
    view.setUint16(5, distance, true);
    view.setUint16(7, ms, true);
    return frame;
  }

  /** Bits of all fields. `moved`: code minus base code per channel; `sums` gathers z per channel. */
  private body(moved: Float64Array, orders: Uint8Array, sums: Float64Array | null): string {
    return this.schema.fields
      .map((f) => {
        const z = residuals(this.schema, f, moved).map((r) => (r >= 0 ? 2 * r : -2 * r - 1));
        if (sums) for (let i = 0; i < f.size; i++) sums[f.start + i]! += z[i]!;
        return z.some((v) => v > 0) ? shortest(z, orders.subarray(f.start, f.start + f.size)) : ALL_ZERO;
      })
      .join('');
  }
}

function residuals(schema: Schema, field: Field, moved: Float64Array): Float64Array {
  const own = moved.slice(field.start, field.start + field.size);
  const partner = field.rel === null ? null : schema.field(field.rel);
  return partner ? own.map((d, i) => d - moved[partner.start + i]!) : own;
}

/** Nibble and codes of one field: walks downhill from what the mean z suggests. */
function shortest(z: Float64Array, orders: Uint8Array): string {
  const coded = (n: number): string => {
    let bits = binary(n, 4);
    for (let i = 0; i < z.length; i++) bits += golomb(z[i]!, shifted(orders[i]!, n));
    return bits;
  };
  const sum = (values: ArrayLike<number>): number => Array.from(values).reduce((a, b) => a + b, 0);
  const usual = Math.floor(sum(orders) / z.length);
  const n = Math.max(0, Math.min(NIBBLE_MAX, orderOf(sum(z) / z.length) - usual + 4));
  let best = coded(n);
  for (const step of [1, -1]) {
    let m = n + step;
    while (m >= 0 && m <= NIBBLE_MAX) {
      const other = coded(m);
      if (other.length >= best.length) break;
      best = other;
      m += step;
    }
    if (m !== n + step) break; // it was downhill this way, so it is uphill the other way
  }
  return best;
}

/** Exp-Golomb code of z ≥ 0 at order k, as a text of 0 and 1. */
function golomb(z: number, k: number): string {
  const bits = (z + 2 ** k).toString(2);
  return '0'.repeat(bits.length - 1 - k) + bits;
}

function shifted(order: number, n: number): number {
  return Math.max(0, Math.min(ORDER_MAX, order + n - 4));
}

function orderOf(meanZ: number): number {
  let k = 0;
  while (k < ORDER_MAX && meanZ >= STEP * 2 ** (k + 1)) k += 1;
  return k;
}

function binary(value: number, width: number): string {
  return value.toString(2).padStart(width, '0');
}

/** A frame with `header` empty bytes, then the bits, first one highest, padded with zeros to whole bytes. */
function packed(header: number, bits: string): Uint8Array<ArrayBuffer> {
  const frame = new Uint8Array(header + Math.ceil(bits.length / 8));
  for (let i = 0; i < bits.length; i++) if (bits[i] === '1') frame[header + (i >> 3)]! |= 0x80 >> (i & 7);
  return frame;
}
