/** The file of a segment: its bytes as they are, or the gzip of them. */

import { ENVELOPE_BYTES_MAX, refuse, SegmentError } from '../segment/segment.ts';

/**
 * The segment's bytes, which are not looked at. What unpacks to more than a segment may have is let go of at once.
 * Rejects with SegmentError.
 */
export async function unpackSegment(data: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  if (data[0] !== 0x1f || data[1] !== 0x8b) return data;
  const pieces: Uint8Array[] = [];
  let size = 0;
  const reader = new Blob([data]).stream().pipeThrough(new DecompressionStream('gzip')).getReader();
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
