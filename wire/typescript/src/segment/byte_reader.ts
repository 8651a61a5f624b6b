import { HASH_BYTES, refuse } from './segment.ts';

const UTF8 = new TextDecoder('utf-8', { fatal: true, ignoreBOM: true });

/** Reads `data` from `at` up to `end`. Whatever is refused is a SegmentError with the byte's offset. */
export class ByteReader {
  constructor(
    readonly data: Uint8Array,
    public at: number,
    public end: number,
  ) {}

  fail(what: string, reason: string): never {
    refuse(`byte ${this.at}`, `${what}: ${reason}`);
  }

  /** The next `count` bytes, not copied. */
  bytes(what: string, count: number): Uint8Array {
    const start = this.at;
    if (count > this.end - start) this.fail(what, `${count} bytes said, ${this.end - start} left`);
    this.at = start + count;
    return this.data.subarray(start, this.at);
  }

  byte(what: string): number {
    return this.bytes(what, 1)[0]!;
  }

  /** A number of eight bytes, as 16 hexadecimal digits. */
  u64(what: string): string {
    return hexOf([...this.bytes(what, 8)].reverse());
  }

  varint(what: string, most = Number.MAX_SAFE_INTEGER): number {
    const { data, at: start } = this;
    const end = Math.min(start + 8, this.end);
    let value = 0;
    for (let i = start, worth = 1; i < end; i++, worth *= 128) {
      const byte = data[i]!;
      value += (byte & 0x7f) * worth;
      if (byte >= 0x80) continue;
      if (byte === 0 && i > start) this.fail(what, 'a number longer than it needs');
      if (value > most) this.fail(what, `${exact(data, start, i)}, ${most} allowed`);
      this.at = i + 1;
      return value;
    }
    this.fail(what, this.end - start < 8 ? 'cut short' : 'a number without an end');
  }

  /** A text of at most `bytesMax` bytes, after its length. */
  text(what: string, bytesMax: number): string {
    return this.utf8(what, this.varint(`${what} length`, bytesMax));
  }

  utf8(what: string, count: number): string {
    const start = this.at;
    const raw = this.bytes(what, count);
    try {
      return UTF8.decode(raw);
    } catch {
      return refuse(`byte ${start}`, `${what}: not UTF-8`);
    }
  }

  /** A SHA-256 in hexadecimal digits, or null. */
  hash(what: string): string | null {
    const size = this.varint(`${what} length`);
    if (size !== 0 && size !== HASH_BYTES) this.fail(what, `a hash of ${size} bytes`);
    return hexOf(this.bytes(what, size)) || null;
  }

  /** Names and texts, of at most `bytesMax` bytes in all. */
  info(what: string, bytesMax: number): Map<string, string> {
    const start = this.at;
    const info = new Map<string, string>();
    for (let left = this.varint(`${what} count`, bytesMax); left > 0; left--) {
      const name = this.text(`${what} name`, bytesMax);
      if (info.has(name)) this.fail(what, 'a name appears twice');
      info.set(name, this.text(`${what} text`, bytesMax));
      if (this.at - start > bytesMax) break;
    }
    if (this.at - start > bytesMax) this.fail(what, `over ${bytesMax} bytes`);
    return info;
  }
}

/** A varint that may lie past 2^53, where numbers are not exact. */
function exact(data: Uint8Array, start: number, last: number): bigint {
  let value = 0n;
  for (let i = last; i >= start; i--) value = (value << 7n) | BigInt(data[i]! & 0x7f);
  return value;
}

export function hexOf(data: Iterable<number>): string {
  let digits = '';
  for (const byte of data) digits += byte.toString(16).padStart(2, '0');
  return digits;
}
