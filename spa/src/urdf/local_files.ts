/** A file that a person dropped on the page. It is read in this browser only and never sent anywhere. */
export interface LocalFile {
  readonly size: number;
  bytes(): Promise<Uint8Array>;
}

export type LocalFiles = ReadonlyMap<string, LocalFile>;

/** A robot in a format that the edge can build models from but the page can't read. */
export interface OtherRobot {
  readonly path: string;
  readonly format: 'xacro' | 'SDF' | 'MJCF';
}

/** Why files are refused: the key of the explanation, with its details. */
export type Refusal =
  | { readonly why: 'dropDamaged' | 'dropNoZip' | 'dropNoUrdf' }
  | { readonly why: 'dropTooMany'; readonly count: number }
  | { readonly why: 'dropBomb' | 'dropTooLarge'; readonly path: string }
  | ({ readonly why: 'dropOtherFormat' } & OtherRobot)
  | { readonly why: 'dropUnreadable'; readonly path: string; readonly what: string };

export class DropError extends Error {
  readonly refusal: Refusal;

  constructor(message: string, refusal: Refusal, options?: ErrorOptions) {
    super(message, options);
    this.refusal = refusal;
  }
}

/** Maximum number of dropped files: with more, somebody has probably dropped a home folder. */
export const MAX_FILES = 5000;
export const MAX_FILE_BYTES = 128_000_000;
export const MAX_ALL_BYTES = 512_000_000;

/** Normalises a path: forward slashes, no `.` or `..`; null if it leads outside the dropped folder. */
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
