import { PastError } from '../past_source.ts';
import type { RecordingFiles } from './recording_files.ts';

/** A `.posecast` file is a ZIP whose entries are stored or deflated. An entry is unpacked only when it is needed, one at a
 *  time. */

/** The maximum number of entries in a recording: 200,000 segments, plus KEYs and models. */
export const ENTRIES_MAX = 250_000;
/** Size limit of the central directory; enough for the longest names in a recording. */
const LIST_BYTES_MAX = 40_000_000;
/** Limit of the total uncompressed size that the entries declare. */
const UNPACKED_BYTES_MAX = 64e9;
/** Deflate can't compress any better than this. */
const GROWTH_MAX = 1032;

const END = 0x06054b50;
const END_BYTES = 22;
const COMMENT_BYTES_MAX = 65_535;
const END64 = 0x06064b50;
const END64_AT = 0x07064b50;
const END64_AT_BYTES = 20;
const ENTRY = 0x02014b50;
const ENTRY_BYTES = 46;
const LOCAL = 0x04034b50;
const LOCAL_BYTES = 30;
const U32 = 0xffff_ffff;

interface Entry {
  readonly deflated: boolean;
  readonly packed: number;
  readonly size: number;
  /** The offset of its local header. */
  readonly at: number;
}

/** A file that is not a readable ZIP, in one line. */
export class PosecastFileError extends Error {}

/** The entries of a `.posecast` file. Rejects with `PosecastFileError`. */
export async function openPosecastFile(file: Blob): Promise<PosecastFile> {
  const tail = await bytesOf(file, Math.max(0, file.size - END_BYTES - COMMENT_BYTES_MAX), file.size);
  const { listAt, listBytes, count } = await findList(file, tail);
  if (count > ENTRIES_MAX) throw new PosecastFileError(`more than ${ENTRIES_MAX} entries`);
  if (listBytes > LIST_BYTES_MAX || listAt + listBytes > file.size)
    throw new PosecastFileError('its list of entries is cut off');
  return new PosecastFile(file, readList(await bytesOf(file, listAt, listAt + listBytes), count));
}

export class PosecastFile implements RecordingFiles {
  constructor(
    private readonly file: Blob,
    private readonly entries: ReadonlyMap<string, Entry>,
  ) {}

  /** The paths of its entries. */
  get names(): string[] {
    return [...this.entries.keys()];
  }

  has(path: string): boolean {
    return this.entries.has(path);
  }

  async read(path: string, most: number, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    const entry = this.entries.get(path);
    if (entry === undefined) throw new PastError('gone', `${path}: no such entry`);
    const { deflated, packed, size, at } = entry;
    if (size > most) throw new PastError('damaged', `${path}: more than ${most} bytes`);
    if (deflated ? size > packed * GROWTH_MAX : size !== packed)
      throw new PastError('damaged', `${path}: an impossible size`);
    const head = viewOf(await this.#bytes(path, at, at + LOCAL_BYTES));
    if (head.byteLength < LOCAL_BYTES || head.getUint32(0, true) !== LOCAL)
      throw new PastError('damaged', `${path}: not where the list says`);
    const from = at + LOCAL_BYTES + head.getUint16(26, true) + head.getUint16(28, true);
    const data = await this.#bytes(path, from, from + packed);
    signal?.throwIfAborted();
    if (data.length !== packed) throw new PastError('damaged', `${path}: cut`);
    if (!deflated) return data;
    const { inflateSync } = await import('fflate');
    try {
      // into a buffer of the declared size: an entry that is longer is not unpacked any further
      const unpacked = inflateSync(data, { out: new Uint8Array(size + 1) });
      if (unpacked.length === size) return unpacked as Uint8Array<ArrayBuffer>;
    } catch {
      // corrupt
    }
    throw new PastError('damaged', `${path}: can't be unpacked`);
  }

  async #bytes(path: string, from: number, to: number): Promise<Uint8Array<ArrayBuffer>> {
    try {
      return await bytesOf(this.file, from, to);
    } catch {
      throw new PastError('gone', `${path}: the file can't be read`);
    }
  }
}

async function bytesOf(file: Blob, from: number, to: number): Promise<Uint8Array<ArrayBuffer>> {
  return new Uint8Array(await file.slice(from, to).arrayBuffer());
}

function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** The position of the central directory, from the end of the file. */
async function findList(file: Blob, tail: Uint8Array) {
  const view = viewOf(tail);
  for (let at = tail.length - END_BYTES; at >= 0; at -= 1) {
    if (view.getUint32(at, true) !== END || at + END_BYTES + view.getUint16(at + 20, true) !== tail.length)
      continue;
    const found = {
      count: view.getUint16(at + 10, true),
      listBytes: view.getUint32(at + 12, true),
      listAt: view.getUint32(at + 16, true),
    };
    const isLarge = found.count === 0xffff || found.listBytes === U32 || found.listAt === U32;
    return isLarge ? findLargeList(file, view, at - END64_AT_BYTES) : found;
  }
  throw new PosecastFileError('not a ZIP file');
}

/** The same for a ZIP with more than 65,534 entries or 4 GB. */
async function findLargeList(file: Blob, tail: DataView, at: number) {
  if (at < 0 || tail.getUint32(at, true) !== END64_AT) throw new PosecastFileError('its end is damaged');
  const endAt = wholeAt(tail, at + 8);
  const view = viewOf(await bytesOf(file, endAt, endAt + 56));
  if (view.byteLength < 56 || view.getUint32(0, true) !== END64)
    throw new PosecastFileError('its end is damaged');
  return { count: wholeAt(view, 32), listBytes: wholeAt(view, 40), listAt: wholeAt(view, 48) };
}

/** A 64-bit integer. */
function wholeAt(view: DataView, at: number): number {
  const value = view.getUint32(at + 4, true) * 2 ** 32 + view.getUint32(at, true);
  if (value > Number.MAX_SAFE_INTEGER) throw new PosecastFileError('an impossible size');
  return value;
}

function readList(list: Uint8Array, count: number): Map<string, Entry> {
  const entries = new Map<string, Entry>();
  const view = viewOf(list);
  const decoder = new TextDecoder();
  let at = 0;
  let total = 0;
  for (let n = 0; n < count; n += 1) {
    if (at + ENTRY_BYTES > list.length || view.getUint32(at, true) !== ENTRY)
      throw new PosecastFileError('its list of entries is damaged');
    const nameBytes = view.getUint16(at + 28, true);
    const extraBytes = view.getUint16(at + 30, true);
    const nameAt = at + ENTRY_BYTES;
    const nextAt = nameAt + nameBytes + extraBytes + view.getUint16(at + 32, true);
    if (nextAt > list.length) throw new PosecastFileError('its list of entries is cut off');
    const [method, flags] = [view.getUint16(at + 10, true), view.getUint16(at + 8, true)];
    const name = decoder.decode(list.subarray(nameAt, nameAt + nameBytes));
    const sizes = readSizes(view, at, { from: nameAt + nameBytes, to: nameAt + nameBytes + extraBytes });
    total += sizes.size;
    if (total > UNPACKED_BYTES_MAX) throw new PosecastFileError('it unpacks to too much data');
    // other methods and encrypted entries are not supported, and recordings have none
    if ((method === 0 || method === 8) && (flags & 1) === 0 && !name.endsWith('/'))
      entries.set(name, { deflated: method === 8, ...sizes });
    at = nextAt;
  }
  return entries;
}

/** Sizes and offset of an entry; values that don't fit into 32 bits follow its name. */
function readSizes(view: DataView, at: number, extra: { from: number; to: number }) {
  const sizes = {
    size: view.getUint32(at + 24, true),
    packed: view.getUint32(at + 20, true),
    at: view.getUint32(at + 42, true),
  };
  if (sizes.size !== U32 && sizes.packed !== U32 && sizes.at !== U32) return sizes;
  for (let field = extra.from; field + 4 <= extra.to; ) {
    const [id, bytes] = [view.getUint16(field, true), view.getUint16(field + 2, true)];
    let value = field + 4;
    const end = Math.min(extra.to, value + bytes);
    field = value + bytes;
    if (id !== 1) continue;
    for (const name of ['size', 'packed', 'at'] as const) {
      if (sizes[name] !== U32) continue;
      if (value + 8 > end) break;
      sizes[name] = wholeAt(view, value);
      value += 8;
    }
  }
  return sizes;
}
