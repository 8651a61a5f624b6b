/** How many bytes are held in the page's memory; Blobs belong to the browser, which moves large ones to disk. */
const PART_BYTES = 4 << 20;

/** Builds a file: about `PART_BYTES` at a time are held here, the rest in Blobs. */
export class BlobParts {
  readonly #blobs: Blob[] = [];
  #pieces: BlobPart[] = [];
  #held = 0;

  /** Adds a copy of bytes, or text as UTF-8. */
  write(piece: Uint8Array | string): void {
    const bytes = typeof piece === 'string' ? new TextEncoder().encode(piece) : piece.slice();
    if (bytes.length === 0) return;
    this.#pieces.push(bytes as Uint8Array<ArrayBuffer>);
    this.#held += bytes.length;
    if (this.#held < PART_BYTES) return;
    this.#blobs.push(new Blob(this.#pieces));
    this.#pieces = [];
    this.#held = 0;
  }

  /** The whole file. */
  blob(type: string): Blob {
    return new Blob([...this.#blobs, ...this.#pieces], { type });
  }
}
