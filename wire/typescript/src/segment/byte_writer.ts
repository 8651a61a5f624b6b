import { HASH_BYTES, refuse } from './segment.ts';

const UTF8 = new TextEncoder();
const SURROGATE = /\p{Cs}/u; // half a pair

/** Collects bytes. */
export class ByteWriter {
  #data = new Uint8Array(1024);
  length = 0;

  /** What has been collected, not copied. */
  get data(): Uint8Array<ArrayBuffer> {
    return this.#data.subarray(0, this.length);
  }

  byte(value: number): void {
    this.#grow(1);
    this.#data[this.length++] = value;
  }

  bytes(data: Uint8Array): void {
    this.#grow(data.length);
    this.#data.set(data, this.length);
    this.length += data.length;
  }

  u32(value: number): void {
    for (let shift = 0; shift < 32; shift += 8) this.byte((value >>> shift) & 0xff);
  }

  /** Of 16 hexadecimal digits. */
  u64(what: string, digits: string): void {
    if (!/^[0-9a-f]{16}$/.test(digits)) refuse(what, 'want 16 hexadecimal digits');
    this.bytes(bytesOf(digits).reverse());
  }

  varint(what: string, value: number, most = Number.MAX_SAFE_INTEGER): void {
    if (!(Number.isInteger(value) && value >= 0 && value <= most))
      refuse(what, `${value}, 0 to ${most} allowed`);
    let left = value;
    for (; left >= 0x80; left = Math.floor(left / 0x80)) this.byte((left % 0x80) | 0x80);
    this.byte(left);
  }

  /** A text after its length. */
  text(what: string, text: string, bytesMax: number): void {
    const raw = utf8Of(what, text, bytesMax);
    this.varint(what, raw.length);
    this.bytes(raw);
  }

  /** A SHA-256 in hexadecimal digits, or null, after its length. */
  hash(what: string, digest: string | null): void {
    this.varint(what, digest === null ? 0 : HASH_BYTES);
    this.bytes(hashOf(what, digest));
  }

  info(what: string, info: ReadonlyMap<string, string>, bytesMax: number): void {
    const start = this.length;
    this.varint(what, info.size);
    for (const [name, text] of info) {
      this.text(what, name, bytesMax);
      this.text(what, text, bytesMax);
    }
    const size = this.length - start;
    if (size > bytesMax) refuse(what, `${size} bytes, ${bytesMax} allowed`);
  }

  #grow(by: number): void {
    if (this.length + by <= this.#data.length) return;
    const larger = new Uint8Array(2 * (this.length + by));
    larger.set(this.#data);
    this.#data = larger;
  }
}

export function utf8Of(what: string, text: string, bytesMax: number): Uint8Array {
  if (SURROGATE.test(text)) refuse(what, 'not Unicode');
  const raw = UTF8.encode(text);
  if (raw.length > bytesMax) refuse(what, `${raw.length} bytes, ${bytesMax} allowed`);
  return raw;
}

/** Of a SHA-256 in hexadecimal digits; none of null. */
export function hashOf(what: string, digest: string | null): Uint8Array {
  if (digest !== null && !/^[0-9a-f]{64}$/.test(digest)) refuse(what, 'no SHA-256');
  return bytesOf(digest ?? '');
}

function bytesOf(digits: string): Uint8Array {
  return Uint8Array.from(digits.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16));
}
