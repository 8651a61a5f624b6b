/** Compresses as an LZ4 frame, as MCAP's chunks may be: message after message repeats its names and most of its numbers. Greedy,
 *  with a table of the last position of each four-byte sequence. It takes about as long as producing the data.
 *
 *  We wrote it because npm has no small, maintained library for it: lz4js is unmaintained CommonJS (its tools date from 2016) and
 *  allocates 5 MiB on import, lz4-browser brings Node's Buffer along (12 kB gzip), @rinsuki/lz4-ts writes no frames, and the
 *  others are WebAssembly or native. */

/** Magic number; version 1 with independent blocks of at most 4 MiB and without checksums (MCAP has its own); checksum of
 *  these two bytes. */
const HEAD = [0x04, 0x22, 0x4d, 0x18, 0x60, 0x70, 0x73];
const BLOCK_BYTES_MAX = 4 << 20;
/** Flag in a block's size: the block is not compressed. */
const PLAIN = 0x8000_0000;
const TABLE_BITS = 14;
const MATCH_MIN = 4;
const OFFSET_MAX = 0xffff;
/** The last bytes of a block are literals, and the last match starts at least this far before its end. */
const LITERALS_LAST = 5;
const MATCH_LAST = 12;
/** After this many bytes without a match, the search skips ever more bytes. */
const PATIENCE_BITS = 6;

const places = new Int32Array(1 << TABLE_BITS);

/** The LZ4 frame of some bytes. */
export function lz4Frame(data: Uint8Array): Uint8Array {
  const blocks = Math.ceil(data.length / BLOCK_BYTES_MAX);
  const out = new Uint8Array(HEAD.length + 4 + blocks * 4 + boundOf(data.length));
  const view = new DataView(out.buffer);
  out.set(HEAD);
  let at = HEAD.length;
  for (let start = 0; start < data.length; start += BLOCK_BYTES_MAX) {
    const block = data.subarray(start, start + BLOCK_BYTES_MAX);
    const end = compress(block, out, at + 4);
    const size = end - at - 4;
    if (size < block.length) {
      view.setUint32(at, size, true);
      at = end;
      continue;
    }
    view.setUint32(at, PLAIN + block.length, true);
    out.set(block, at + 4);
    at += 4 + block.length;
  }
  view.setUint32(at, 0, true); // end mark
  return out.subarray(0, at + 4);
}

/** The maximum size of any compressed block, reached with incompressible data. */
function boundOf(size: number): number {
  return size + Math.ceil(size / 255) + 16;
}

/** Writes the block of `data` starting at `at`; returns its end. */
function compress(data: Uint8Array, out: Uint8Array, at: number): number {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const size = data.length;
  let end = at;
  let literals = 0; // start of the literals not yet written
  places.fill(-1);
  for (let i = 0; i < size - MATCH_LAST; ) {
    const four = view.getUint32(i, true);
    const hash = Math.imul(four, 0x9e3779b1) >>> (32 - TABLE_BITS);
    const seen = places[hash]!;
    places[hash] = i;
    if (seen < 0 || i - seen > OFFSET_MAX || view.getUint32(seen, true) !== four) {
      i += 1 + ((i - literals) >> PATIENCE_BITS);
      continue;
    }
    let length = MATCH_MIN;
    while (i + length < size - LITERALS_LAST && data[seen + length] === data[i + length]) length++;
    end = writeSequence(data, literals, i, out, end, length - MATCH_MIN);
    out[end++] = (i - seen) & 0xff;
    out[end++] = (i - seen) >> 8;
    end = writeLength(out, end, length - MATCH_MIN);
    i += length;
    literals = i;
  }
  return writeSequence(data, literals, size, out, end, 0);
}

/** Writes the token, and the literals from `from` to `to`; `match`: the length of the following match, minus the minimum. */
function writeSequence(
  data: Uint8Array,
  from: number,
  to: number,
  out: Uint8Array,
  at: number,
  match: number,
): number {
  const count = to - from;
  out[at] = (Math.min(15, count) << 4) | Math.min(15, match);
  const end = writeLength(out, at + 1, count);
  out.set(data.subarray(from, to), end);
  return end + count;
}

/** Writes the part of a length that does not fit into the token. */
function writeLength(out: Uint8Array, at: number, length: number): number {
  if (length < 15) return at;
  let left = length - 15;
  let end = at;
  for (; left >= 255; left -= 255) out[end++] = 255;
  out[end++] = left;
  return end;
}
