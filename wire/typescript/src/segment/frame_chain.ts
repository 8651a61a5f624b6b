import { BadFrame, frameId, type Header, parseHeader } from '../frame.ts';
import { SegmentError } from './segment.ts';

const SEQS = 2 ** 32; // a frame's number goes round

/** Follows the frames of a segment by their headers: each has its base here, and their numbers rise. */
export class FrameChain {
  count = 0;
  copies = 0;
  firstSeq = 0;
  lastSeq = 0;
  #schemaId: number | null = null;
  #key: { readonly id: number; readonly seq: number } | null = null;

  /** Takes a copy of the KEY. */
  addCopy(frame: Uint8Array): void {
    const header = parse(frame);
    if (this.count > 0) throw new SegmentError('copy: behind a frame');
    if (this.copies > 0 || !header.isKey) throw new SegmentError('copy: want one KEY');
    this.#take(frame, header);
    this.copies++;
  }

  /** Takes a frame and says its number. */
  addFrame(frame: Uint8Array): number {
    const header = parse(frame);
    if (header.isKey) {
      if (this.copies > 0 && this.count === 0) throw new SegmentError('frame: a KEY behind copies');
      if (this.#schemaId !== null && this.#schemaId !== header.schemaId)
        throw new SegmentError('frame: a KEY of another schema');
    }
    const seq = this.#seq(header);
    if (this.count > 0 && (seq - this.lastSeq - 1 + 2 * SEQS) % SEQS >= SEQS / 2)
      throw new SegmentError(`frame: number ${seq} after ${this.lastSeq}`);
    if (header.isKey) this.#take(frame, header);
    if (this.count === 0) this.firstSeq = seq;
    this.lastSeq = seq;
    this.count++;
    return seq;
  }

  #take(frame: Uint8Array, { schemaId, seq }: Header & { isKey: true }): void {
    this.#key = { id: frameId(frame), seq };
    this.#schemaId = schemaId;
  }

  #seq(header: Header): number {
    if (header.isKey) return header.seq;
    if (this.#key?.id === header.baseId) return (this.#key.seq + header.distance) % SEQS;
    throw new SegmentError(`frame: its base ${header.baseId.toString(16).padStart(8, '0')} is not here`);
  }
}

function parse(frame: Uint8Array): Header {
  try {
    return parseHeader(frame);
  } catch (error) {
    if (error instanceof BadFrame) throw new SegmentError(`frame: ${error.message}`);
    throw error;
  }
}
