import { PastError } from '../past_source.ts';
import type { RecordingFiles } from './recording_files.ts';

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
