import { bytesOf, listZip, viewOf, ZipError } from '../../zip.ts';
import { PastError } from '../past_source.ts';
import type { RecordingFiles } from './recording_files.ts';

/** A `.posecast` file is a ZIP whose entries are stored or deflated. An entry is unpacked only when it is needed, one at a
 *  time. */

/** The maximum number of entries in a recording: 200,000 segments, plus KEYs and models. */
export const ENTRIES_MAX = 250_000;
/** Limit of the total uncompressed size that the entries declare. */
const UNPACKED_BYTES_MAX = 64e9;
/** Deflate can't compress any better than this. */
const GROWTH_MAX = 1032;

const LOCAL = 0x04034b50;
const LOCAL_BYTES = 30;

interface Entry {
  readonly deflated: boolean;
  readonly packed: number;
  readonly size: number;
  /** The offset of its local header. */
  readonly at: number;
}

/** A file that is not a readable ZIP, in one line. */
export const PosecastFileError = ZipError;

/** The entries of a `.posecast` file. Rejects with `PosecastFileError`. */
export async function openPosecastFile(file: Blob): Promise<PosecastFile> {
  const entries = new Map<string, Entry>();
  const decoder = new TextDecoder();
  let total = 0;
  for (const { name, flags, method, packed, size, at } of await listZip(file, ENTRIES_MAX)) {
    total += size;
    if (total > UNPACKED_BYTES_MAX) throw new ZipError('it unpacks to too much data');
    const path = decoder.decode(name);
    // other methods and encrypted entries are not supported, and recordings have none
    if ((method === 0 || method === 8) && (flags & 1) === 0 && !path.endsWith('/'))
      entries.set(path, { deflated: method === 8, packed, size, at });
  }
  return new PosecastFile(file, entries);
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
