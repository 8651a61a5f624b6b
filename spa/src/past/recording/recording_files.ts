import { PastError } from '../past_source.ts';
import { type FetchPorts, fetchTwice } from '../requests.ts';

/** The files of a recording on a web server, below a folder's URL. */
export class FetchedFiles implements RecordingFiles {
  /** `folder` ends with a slash. */
  constructor(
    private readonly folder: string,
    private readonly ports: FetchPorts,
  ) {}

  async read(path: string, most: number, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    const url = new URL(path, this.folder).href;
    const wanted = { url, name: path, most, signal, cutTwice: 'damaged' } as const;
    return (await fetchTwice(wanted, this.ports)).bytes;
  }
}

/** Finds a file below a dropped or chosen folder by its path; null if there is none. */
export type FindFile = (path: string) => Promise<File | null>;

/** The files of a recording in a folder on this computer. Each is read on demand, and never sent. */
export class FolderFiles implements RecordingFiles {
  constructor(private readonly find: FindFile) {}

  async read(path: string, most: number, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    const file = await this.find(path);
    signal?.throwIfAborted();
    if (file === null) throw new PastError('gone', `${path}: no such file`);
    if (file.size > most) throw new PastError('damaged', `${path}: more than ${most} bytes`);
    try {
      return new Uint8Array(await file.arrayBuffer());
    } catch {
      throw new PastError('gone', `${path}: can't be read`); // it existed when the folder was dropped
    }
  }
}

/** Finds files in a dropped folder. The folder is not listed, because it may contain 200,000 files. */
export function inDroppedFolder(folder: FileSystemDirectoryEntry): FindFile {
  return (path) =>
    new Promise((resolve) => {
      const none = () => resolve(null);
      folder.getFile(path, {}, (entry) => (entry as FileSystemFileEntry).file(resolve, none), none);
    });
}

/** Finds files by their paths below a chosen folder: `lecture/recording.json`. `root` ends with a slash, or is empty. */
export function inChosenFolder(files: ReadonlyMap<string, File>, root: string): FindFile {
  return async (path) => files.get(root + path) ?? null;
}

/** Storage of a recording's files (`wire/SPEC.md`, §12): a web server, a dropped folder, or a single file. */
export interface RecordingFiles {
  /** The bytes of a file by its path, such as `segments/8f14e45fceea167a/12.segment`. Rejects with a `PastError`: `gone` if it
   *  does not exist, `damaged` if it is truncated or has more than `most` bytes, `away` if it may become available later. */
  read(path: string, most: number, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>>;
}

export { modelPath, RECORDING_FILE } from '@posecast/wire';

/** Maximum size of each kind of file. */
export const BYTES_MAX = { index: 32 << 20, segment: 3_000_000, keys: 1 << 20, model: 64 << 20 } as const;
