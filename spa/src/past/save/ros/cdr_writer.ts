const UTF8 = new TextEncoder();
/** Little endian, without parameters. */
const ENCAPSULATION = [0, 1, 0, 0];

/** Writes ROS 2 messages as CDR (XCDR1, little endian): each number is aligned to its size, counted from the end of the four-byte
 *  header. All messages share one buffer. */
export class CdrWriter {
  #bytes = new Uint8Array(4096);
  #view = new DataView(this.#bytes.buffer);
  #at = 0;

  /** Starts a message. */
  begin(): void {
    this.#at = 0;
    this.#room(4);
    this.#bytes.set(ENCAPSULATION);
    this.#at = 4;
  }

  /** The message, not copied. */
  get bytes(): Uint8Array {
    return this.#bytes.subarray(0, this.#at);
  }

  u8(value: number): void {
    this.#room(1);
    this.#bytes[this.#at++] = value;
  }

  u32(value: number): void {
    this.#align(4);
    this.#view.setUint32(this.#at, value, true);
    this.#at += 4;
  }

  i32(value: number): void {
    this.#align(4);
    this.#view.setInt32(this.#at, value, true);
    this.#at += 4;
  }

  f64(value: number): void {
    this.#align(8);
    this.#view.setFloat64(this.#at, value, true);
    this.#at += 8;
  }

  /** A text with its length, which includes the terminating zero. */
  text(text: string): void {
    this.utf8(utf8Of(text));
  }

  /** A text that is already UTF-8. */
  utf8(utf8: Uint8Array): void {
    this.u32(utf8.length + 1);
    this.#room(utf8.length + 1);
    this.#bytes.set(utf8, this.#at);
    this.#at += utf8.length;
    this.#bytes[this.#at++] = 0;
  }

  /** A sequence of numbers, preceded by its length. */
  f64s(values: ArrayLike<number>): void {
    this.u32(values.length);
    for (let i = 0; i < values.length; i++) this.f64(values[i]!);
  }

  #align(size: number): void {
    this.#room(2 * size);
    for (const end = this.#at + ((4 - this.#at) & (size - 1)); this.#at < end; ) this.#bytes[this.#at++] = 0;
  }

  #room(count: number): void {
    if (this.#at + count <= this.#bytes.length) return;
    const larger = new Uint8Array(2 * (this.#at + count));
    larger.set(this.#bytes);
    this.#bytes = larger;
    this.#view = new DataView(larger.buffer);
  }
}

/** A text as bytes; a zero in it, which would end it, is dropped. */
export function utf8Of(text: string): Uint8Array {
  return UTF8.encode(text.replaceAll('\0', ''));
}
