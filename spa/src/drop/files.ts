/** What a person dropped, by path: read here, in this browser; nothing of it is ever sent. */
export interface LocalFile {
  readonly size: number;
  bytes(): Promise<Uint8Array>;
}

export type LocalFiles = ReadonlyMap<string, LocalFile>;

export class DropError extends Error {}

/** More is no robot: somebody dropped a home folder. */
export const MAX_FILES = 5000;
export const MAX_FILE_BYTES = 128_000_000;
export const MAX_ALL_BYTES = 512_000_000;

/** A path as the map keeps it: forward slashes, no `.`; null when it leads out of what was dropped. */
export function tidyPath(path: string): string | null {
  const parts: string[] = [];
  for (const part of path.replaceAll('\\', '/').split('/')) {
    if (part === '' || part === '.') continue;
    if (part === '..') {
      if (parts.pop() === undefined) return null;
    } else parts.push(part);
  }
  return parts.join('/');
}

/** The files of a drop, folders walked. Throws a DropError of one line. */
export async function filesOf(entries: readonly FileSystemEntry[]): Promise<Map<string, File>> {
  const found = new Map<string, File>();
  const waiting = [...entries];
  for (let entry = waiting.pop(); entry !== undefined; entry = waiting.pop()) {
    if (entry.isFile) {
      const at = entry as FileSystemFileEntry;
      found.set(tidyPath(at.fullPath) ?? at.name, await new Promise<File>((yes, no) => at.file(yes, no)));
      if (found.size > MAX_FILES)
        throw new DropError(`More than ${MAX_FILES} files: is this the robot's folder?`);
      continue;
    }
    const reader = (entry as FileSystemDirectoryEntry).createReader();
    for (;;) {
      // A reader gives at most a hundred entries at a time.
      const some = await new Promise<FileSystemEntry[]>((yes, no) => reader.readEntries(yes, no));
      if (some.length === 0) break;
      waiting.push(...some);
    }
  }
  return found;
}

/** Dropped or chosen files as local ones, a zip among them unpacked. Throws a DropError of one line. */
export async function localFiles(files: ReadonlyMap<string, File>): Promise<LocalFiles> {
  const local = new Map<string, LocalFile>();
  for (const [path, file] of files) {
    if (/\.zip$/i.test(path) && files.size === 1) {
      const { unzip } = await import('./unzip.ts');
      return unzip(file);
    }
    if (file.size > MAX_FILE_BYTES) continue; // shown as missing, by name
    local.set(path, { size: file.size, bytes: async () => new Uint8Array(await file.arrayBuffer()) });
  }
  return local;
}
