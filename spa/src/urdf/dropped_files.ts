/** What a person dropped, by path: read here, in this browser; nothing of it is ever sent. */
export interface LocalFile {
  readonly size: number;
  bytes(): Promise<Uint8Array>;
}

export type LocalFiles = ReadonlyMap<string, LocalFile>;

/** Why files are refused; the name of the sentence that says so, and what it speaks of. */
export type Refusal =
  | { readonly why: 'dropDamaged' | 'dropNoZip' | 'dropNoUrdf' }
  | { readonly why: 'dropTooMany'; readonly count: number }
  | { readonly why: 'dropBomb' | 'dropTemplate' | 'dropTooLarge'; readonly path: string }
  | { readonly why: 'dropUnreadable'; readonly path: string; readonly what: string };

export class DropError extends Error {
  readonly refusal: Refusal;

  constructor(message: string, refusal: Refusal, options?: ErrorOptions) {
    super(message, options);
    this.refusal = refusal;
  }
}

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
        // A reader gives at most a hundred entries at a time.
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
