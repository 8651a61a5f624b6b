import {
  DropError,
  isResourceFork,
  type LocalFile,
  type LocalFiles,
  MAX_FILE_BYTES,
  MAX_FILES,
  tidyPath,
} from './local_files.ts';

/** The files of a drop by path, including those in folders. Rejects with DropError. */
export async function filesOf(dropped: readonly (FileSystemEntry | File)[]): Promise<Map<string, File>> {
  const found = new Map<string, File>();
  const waiting = [...dropped];
  for (let entry = waiting.pop(); entry !== undefined; entry = waiting.pop()) {
    if (entry instanceof File) found.set(entry.name, entry);
    else if (entry.isFile) {
      const at = entry as FileSystemFileEntry;
      found.set(tidyPath(at.fullPath) ?? at.name, await new Promise<File>((yes, no) => at.file(yes, no)));
    } else {
      const reader = (entry as FileSystemDirectoryEntry).createReader();
      for (;;) {
        // A reader returns at most a hundred entries at a time.
        const some = await new Promise<FileSystemEntry[]>((yes, no) => reader.readEntries(yes, no));
        if (some.length === 0) break;
        waiting.push(...some);
      }
    }
    if (found.size > MAX_FILES)
      throw new DropError(`More than ${MAX_FILES} files: is this the robot's folder?`, {
        why: 'dropTooMany',
        count: MAX_FILES,
      });
  }
  return found;
}

/** Turns dropped or chosen files into local files; zip files are unpacked. Rejects with DropError. */
export async function localFiles(files: ReadonlyMap<string, File>): Promise<LocalFiles> {
  const local = new Map<string, LocalFile>();
  for (const [path, file] of files) {
    if (/\.zip$/i.test(path) && files.size === 1) {
      const { unzip } = await import('./unzip.ts');
      return unzip(file);
    }
    if (file.size > MAX_FILE_BYTES || isResourceFork(path)) continue; // will be reported as missing
    local.set(path, { size: file.size, bytes: async () => new Uint8Array(await file.arrayBuffer()) });
  }
  return local;
}
