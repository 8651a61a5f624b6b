import { readText } from './text.ts';
import { XmlRefused } from './xml.ts';

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

/** Whether it is what a Mac notes about a file beside it, as in zips that were made on one. */
export function isResourceFork(path: string): boolean {
  return /(?:^|\/)(?:__MACOSX\/|\._[^/]*$|\.DS_Store$)/.test(path);
}

type OtherFormat = OtherRobot['format'];

const ROOTS: Readonly<Record<string, OtherFormat>> = { mujoco: 'MJCF', sdf: 'SDF', gazebo: 'SDF' };
const MAX_LOOKED_AT = 50;
const MAX_BYTES = 8 << 20;
/** What may precede the root element: how it begins, how it ends. */
const BEFORE_ROOT = [
  ['<?', '?>'],
  ['<!--', '-->'],
] as const;

/** The first of `paths` that is a robot in another format: by its name, or for `.xml` by its root element. */
export async function findOther(files: LocalFiles, paths: readonly string[]): Promise<OtherRobot | null> {
  let left = MAX_LOOKED_AT;
  for (const path of paths) {
    if (/\.xacro$/i.test(path)) return { path, format: 'xacro' };
    if (/\.sdf$/i.test(path)) return { path, format: 'SDF' };
    if (!/\.(xml|mjcf|world)$/i.test(path) || left-- <= 0) continue;
    const format = await readFormat(files.get(path)!);
    if (format !== null) return { path, format };
  }
  return null;
}

async function readFormat(file: LocalFile): Promise<OtherFormat | null> {
  if (file.size > MAX_BYTES) return null;
  try {
    return otherFormatOf(readText(await file.bytes()).text);
  } catch (cause) {
    if (cause instanceof XmlRefused) return null;
    throw cause;
  }
}

/** The format of an XML text by its root element; null if it is none of them, such as URDF. */
export function otherFormatOf(text: string): OtherFormat | null {
  const space = /\s*/y;
  for (let at = 0; ; ) {
    space.lastIndex = at;
    space.test(text);
    at = space.lastIndex;
    const remark = BEFORE_ROOT.find(([begin]) => text.startsWith(begin, at));
    if (remark === undefined) {
      const root = /^<([\w:.-]{1,40})/.exec(text.slice(at, at + 50))?.[1] ?? '';
      return Object.hasOwn(ROOTS, root) ? ROOTS[root]! : null;
    }
    const end = text.indexOf(remark[1], at + remark[0].length);
    if (end < 0) return null;
    at = end + remark[1].length;
  }
}

/** The path as typed in a shell; a placeholder word if it would need quoting. */
export function typedPath(path: string): string {
  return /^(?!-)[\p{L}\p{N}_./+-]+$/u.test(path) ? path : 'FILE';
}
