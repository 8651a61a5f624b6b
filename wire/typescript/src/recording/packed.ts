/** The file of a segment: its bytes as they are, or the gzip of them. */

import { ENVELOPE_BYTES_MAX, refuse, SegmentError } from '../segment/segment.ts';

/** Unpacked at once. A browser unpacks a whole chunk before anybody can count what came out, up to 1032 times its size. */
const SLICE_BYTES = 4096;

/**
 * The segment's bytes, which are not looked at. What unpacks to more than a segment may have is let go of at once.
 * Rejects with SegmentError.
 */
export async function unpackSegment(data: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  if (data[0] !== 0x1f || data[1] !== 0x8b) return data;
  const pieces: Uint8Array[] = [];
  let size = 0;
  const reader = slicesOf(data).pipeThrough(new DecompressionStream('gzip')).getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      pieces.push(value);
      size += value.length;
      if (size > ENVELOPE_BYTES_MAX) refuse('gzip', `over ${ENVELOPE_BYTES_MAX} bytes`);
    }
  } catch (error) {
    void reader.cancel().catch(() => {});
    if (error instanceof SegmentError) throw error;
    refuse('gzip', 'damaged');
  }
  const segment = new Uint8Array(size);
  let at = 0;
  for (const piece of pieces) {
    segment.set(piece, at);
    at += piece.length;
  }
  return segment;
}

/** Gives a slice whenever the one before has been unpacked and read. */
function slicesOf(data: Uint8Array<ArrayBuffer>): ReadableStream<Uint8Array<ArrayBuffer>> {
  let at = 0;
  return new ReadableStream({
    pull(slices) {
      slices.enqueue(data.subarray(at, at + SLICE_BYTES));
      at += SLICE_BYTES;
      if (at >= data.length) slices.close();
    },
  });
}
