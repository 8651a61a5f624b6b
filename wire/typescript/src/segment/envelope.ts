/** What is around a header and records: a magic number, a version, lengths, and checksums. */

import { ByteReader } from './byte_reader.ts';
import { ByteWriter } from './byte_writer.ts';
import {
  CRC_BYTES,
  HEADER_BYTES_MAX,
  PREFIX_BYTES,
  RECORDS_BYTES_MAX,
  refuse,
  TAIL_BYTES,
} from './segment.ts';

/** What kind of thing it is; `what` is a word for it. */
export interface EnvelopeKind {
  readonly magic: readonly number[];
  readonly version: number;
  readonly what: string;
}

/** The two parts, with correct checksums. `count`: the number of records that the last bytes name. */
export interface Envelope {
  readonly header: ByteReader;
  readonly records: ByteReader;
  readonly count: number;
}

/** Checks lengths and checksums. SegmentError when it is none or damaged. */
export function openEnvelope(data: Uint8Array, kind: EnvelopeKind): Envelope {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const headerEnd = checkFront(data, view, kind);
  const [at, end] = [headerEnd + CRC_BYTES, data.length - TAIL_BYTES];
  const count = checkRecords(data, view, at, end);
  const header = new ByteReader(data, PREFIX_BYTES, headerEnd);
  return { header, records: new ByteReader(data, at, end), count };
}

/** Checks the header and returns where it ends. */
function checkFront(data: Uint8Array, view: DataView, { magic, version, what }: EnvelopeKind): number {
  if (magic.some((byte, i) => i < data.length && data[i] !== byte)) refuse('byte 0', `no ${what}`);
  if (data.length > 4 && data[4] !== version) {
    const why = data[4]! > version ? 'made by a newer Posecast' : `this reader knows ${version}`;
    refuse('byte 4', `version ${data[4]}, ${why}`);
  }
  if (data.length < PREFIX_BYTES) refuse(`byte ${data.length}`, 'cut short');
  const size = view.getUint32(5, true);
  if (size > HEADER_BYTES_MAX) refuse('byte 5', `header of ${size} bytes, ${HEADER_BYTES_MAX} allowed`);
  const end = PREFIX_BYTES + size;
  if (data.length < end + CRC_BYTES + TAIL_BYTES) refuse(`byte ${data.length}`, 'cut short');
  if (crc32(data.subarray(0, end)) !== view.getUint32(end, true)) refuse(`byte ${end}`, 'header: damaged');
  return end;
}

/** Checks the records' bytes and returns the number of records that the last bytes name. */
function checkRecords(data: Uint8Array, view: DataView, at: number, end: number): number {
  if (end - at > RECORDS_BYTES_MAX)
    refuse(`byte ${at}`, `records of ${end - at} bytes, ${RECORDS_BYTES_MAX} allowed`);
  if (data[end] !== 0) refuse(`byte ${end}`, 'no end: cut short or damaged');
  if (crc32(data.subarray(at, end)) !== view.getUint32(end + 5, true))
    refuse(`byte ${end}`, 'records: damaged');
  return view.getUint32(end + 1, true);
}

/** Puts around a header and records what `openEnvelope` checks. */
export function packEnvelope(
  kind: EnvelopeKind,
  header: Uint8Array,
  records: Uint8Array,
  count: number,
): Uint8Array {
  const all = new ByteWriter();
  all.bytes(Uint8Array.from([...kind.magic, kind.version]));
  all.u32(header.length);
  all.bytes(header);
  all.u32(crc32(all.data));
  all.bytes(records);
  all.byte(0);
  all.u32(count);
  all.u32(crc32(records));
  return all.data.slice();
}

const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let bit = 0; bit < 8; bit++) c = c & 1 ? (c >>> 1) ^ 0xedb88320 : c >>> 1;
  return c;
});

/** CRC-32 as in PNG and zlib (ISO 3309). It catches damage, not intent. */
function crc32(data: Uint8Array): number {
  let c = 0xffffffff;
  for (let i = 0; i < data.length; i++) c = TABLE[(c ^ data[i]!) & 0xff]! ^ (c >>> 8);
  return ~c >>> 0;
}
