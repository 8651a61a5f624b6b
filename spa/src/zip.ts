/** Reads a ZIP's list of entries, its central directory. */

/** Size limit of the list; enough for the longest names in a recording. */
const LIST_BYTES_MAX = 40_000_000;

const END = 0x06054b50;
const END_BYTES = 22;
const COMMENT_BYTES_MAX = 65_535;
const END64 = 0x06064b50;
const END64_AT = 0x07064b50;
const END64_AT_BYTES = 20;
const ENTRY = 0x02014b50;
const ENTRY_BYTES = 46;
const U32 = 0xffff_ffff;

/** A file that is not a readable ZIP, in one line. */
export class ZipError extends Error {}

export interface ZipEntry {
  /** Its path, in whatever encoding. */
  readonly name: Uint8Array;
  readonly flags: number;
  /** 0: stored; 8: deflated. */
  readonly method: number;
  /** Size of its data in the ZIP. */
  readonly packed: number;
  /** Size when unpacked. */
  readonly size: number;
  /** The offset of its local header. */
  readonly at: number;
}

/** The entries of a ZIP, at most `most`. Rejects with ZipError. */
export async function listZip(file: Blob, most: number): Promise<ZipEntry[]> {
  const tail = await bytesOf(file, Math.max(0, file.size - END_BYTES - COMMENT_BYTES_MAX), file.size);
  const { listAt, listBytes, count } = await findList(file, tail);
  if (count > most) throw new ZipError(`more than ${most} entries`);
  if (listBytes > LIST_BYTES_MAX || listAt + listBytes > file.size)
    throw new ZipError('its list of entries is cut off');
  return readList(await bytesOf(file, listAt, listAt + listBytes), count);
}

export async function bytesOf(file: Blob, from: number, to: number): Promise<Uint8Array<ArrayBuffer>> {
  return new Uint8Array(await file.slice(from, to).arrayBuffer());
}

export function viewOf(bytes: Uint8Array): DataView {
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
  throw new ZipError('not a ZIP file');
}

/** The same for a ZIP with more than 65,534 entries or 4 GB. */
async function findLargeList(file: Blob, tail: DataView, at: number) {
  if (at < 0 || tail.getUint32(at, true) !== END64_AT) throw new ZipError('its end is damaged');
  const endAt = wholeAt(tail, at + 8);
  const view = viewOf(await bytesOf(file, endAt, endAt + 56));
  if (view.byteLength < 56 || view.getUint32(0, true) !== END64) throw new ZipError('its end is damaged');
  return { count: wholeAt(view, 32), listBytes: wholeAt(view, 40), listAt: wholeAt(view, 48) };
}

/** A 64-bit integer. */
function wholeAt(view: DataView, at: number): number {
  const value = view.getUint32(at + 4, true) * 2 ** 32 + view.getUint32(at, true);
  if (value > Number.MAX_SAFE_INTEGER) throw new ZipError('an impossible size');
  return value;
}

function readList(list: Uint8Array, count: number): ZipEntry[] {
  const entries: ZipEntry[] = [];
  const view = viewOf(list);
  let at = 0;
  for (let n = 0; n < count; n += 1) {
    if (at + ENTRY_BYTES > list.length || view.getUint32(at, true) !== ENTRY)
      throw new ZipError('its list of entries is damaged');
    const nameBytes = view.getUint16(at + 28, true);
    const extraBytes = view.getUint16(at + 30, true);
    const nameAt = at + ENTRY_BYTES;
    const nextAt = nameAt + nameBytes + extraBytes + view.getUint16(at + 32, true);
    if (nextAt > list.length) throw new ZipError('its list of entries is cut off');
    const sizes = readSizes(view, at, { from: nameAt + nameBytes, to: nameAt + nameBytes + extraBytes });
    const [method, flags] = [view.getUint16(at + 10, true), view.getUint16(at + 8, true)];
    entries.push({ name: list.subarray(nameAt, nameAt + nameBytes), flags, method, ...sizes });
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
