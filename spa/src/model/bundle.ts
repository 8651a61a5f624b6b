import { tokenFor } from '../auth/token.ts';

/**
 * A robot's bundle over HTTP: the manifest names every file, the scene fetches those it needs.
 *
 * Version 1, the raw bundle: `{"v":1,"urdf":"robot.urdf","files":[{"path","uri","size",…}],"missing":["package://…"]}`.
 * `uri` is the exact string that the URDF uses, so nothing has to be resolved here.
 */

const MAX_MANIFEST_BYTES = 4_000_000;
/** A single file above this is refused: the edge would not send it either, and a phone could not hold it. */
const MAX_FILE_BYTES = 128_000_000;
const MAX_BUNDLE_BYTES = 512_000_000;
/** More than a browser opens to one host over HTTP/1.1 only waits; fewer leaves a slow link idle between files. */
const PARALLEL = 6;

export class BundleError extends Error {}

export interface BundleFile {
  path: string;
  uri: string;
  size: number;
}

export interface RawManifest {
  urdf: BundleFile;
  files: ReadonlyMap<string, BundleFile>;
  /** URIs of which the edge already knows that it has no file. */
  missing: ReadonlySet<string>;
}

/** Where a raw bundle's files come from: a relay, or what somebody dropped on the page. */
export interface RawFiles {
  /** Rejects with an Error of one line. */
  fetch(file: BundleFile): Promise<Uint8Array>;
  /** A file that another one names, by its place beside it; null where there is none. */
  beside?(file: BundleFile, name: string): Promise<Uint8Array | null>;
}

/** A manifest of any version. Throws BundleError when the text is not one. */
export function parseManifest(text: string): Readonly<Record<string, unknown>> {
  let raw: unknown;
  try {
    raw = JSON.parse(text);
  } catch {
    throw new BundleError('model manifest: not JSON');
  }
  if (!isRecord(raw)) throw new BundleError('model manifest: no object');
  return raw;
}

/** Reads a manifest of version 1; throws BundleError that says what is wrong with it. */
export function readRawManifest(raw: Readonly<Record<string, unknown>>): RawManifest {
  if (raw.v !== 1) throw new BundleError('model manifest: neither version 1 nor 2');
  if (!Array.isArray(raw.files)) throw new BundleError('model manifest: no list of files');
  const files = new Map<string, BundleFile>();
  let urdf: BundleFile | undefined;
  let total = 0;
  for (const [index, entry] of raw.files.entries()) {
    const file = parseFile(entry, index);
    total += file.size;
    files.set(file.uri, file);
    if (file.path === raw.urdf) urdf = file;
  }
  if (total > MAX_BUNDLE_BYTES) throw new BundleError(`model manifest: ${total} bytes are too many`);
  if (urdf === undefined) throw new BundleError('model manifest: its URDF is not among its files');
  const missing = Array.isArray(raw.missing) ? raw.missing.filter((uri) => typeof uri === 'string') : [];
  return { urdf, files, missing: new Set(missing) };
}

function parseFile(entry: unknown, index: number): BundleFile {
  const where = `model manifest: file ${index}`;
  if (!isRecord(entry)) throw new BundleError(`${where} is no object`);
  const { path, uri, size } = entry;
  if (typeof path !== 'string' || !isInside(path)) throw new BundleError(`${where}: bad path`);
  if (typeof uri !== 'string' || uri === '') throw new BundleError(`${where}: no uri`);
  if (typeof size !== 'number' || !Number.isSafeInteger(size) || size < 0 || size > MAX_FILE_BYTES) {
    throw new BundleError(`${where} (${path}): bad size`);
  }
  return { path, uri, size };
}

/** A relative path that stays below the manifest. */
function isInside(path: string): boolean {
  return path.split('/').every((part) => part !== '' && part !== '.' && part !== '..');
}

/** The address of a bundle's file, beside its manifest. */
export function fileUrl(manifestUrl: string, file: { readonly path: string }): string {
  return manifestUrl.replace(/[^/]*$/, '') + file.path.split('/').map(encodeURIComponent).join('/');
}

export async function fetchManifest(
  url: string,
  signal: AbortSignal,
): Promise<Readonly<Record<string, unknown>>> {
  return parseManifest(new TextDecoder().decode(await fetchBytes(url, MAX_MANIFEST_BYTES, signal, () => {})));
}

/** Fetches a bundle's files, few at a time, and counts real bytes over all of them. */
export class Download {
  readonly #manifestUrl: string;
  readonly #signal: AbortSignal;
  readonly #onBytes: (received: number) => void;
  readonly #waiting: (() => void)[] = []; // at most one entry for each file of the manifest
  #running = 0;
  #received = 0;

  constructor(manifestUrl: string, signal: AbortSignal, onBytes: (received: number) => void) {
    this.#manifestUrl = manifestUrl;
    this.#signal = signal;
    this.#onBytes = onBytes;
  }

  /** The file's bytes; a BundleError when it can't be had or is not of the size that the manifest says. */
  async fetch(file: BundleFile): Promise<Uint8Array> {
    if (this.#running >= PARALLEL) await new Promise<void>((resolve) => this.#waiting.push(resolve));
    this.#running += 1;
    let mine = 0;
    try {
      const url = fileUrl(this.#manifestUrl, file);
      const bytes = await fetchBytes(url, file.size, this.#signal, (more) => {
        mine += more;
        this.#count(more);
      });
      if (bytes.length !== file.size) {
        throw new BundleError(`${file.path}: ${bytes.length} bytes instead of ${file.size}`);
      }
      return bytes;
    } finally {
      this.#count(file.size - mine); // a lost file is done with, too: the bar must reach its end
      this.#running -= 1;
      this.#waiting.shift()?.();
    }
  }

  #count(more: number): void {
    this.#received += more;
    if (more !== 0 && !this.#signal.aborted) this.#onBytes(this.#received);
  }
}

/** A response's body, never more than `limit` bytes of it; `onBytes` hears of each piece. */
export async function fetchBytes(
  url: string,
  limit: number,
  signal: AbortSignal,
  onBytes: (more: number) => void,
): Promise<Uint8Array> {
  const name = url.slice(url.lastIndexOf('/') + 1);
  let response: Response;
  try {
    const token = tokenFor(url);
    const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
    response = await fetch(url, { signal, credentials: 'omit', headers });
  } catch (cause) {
    throw new BundleError(`${name}: no answer`, { cause });
  }
  if (!response.ok) throw new BundleError(`${name}: answered ${response.status}`);
  const reader = response.body?.getReader();
  if (reader === undefined) return new Uint8Array();
  const chunks: Uint8Array[] = [];
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    length += value.length;
    if (length > limit) {
      await reader.cancel();
      throw new BundleError(`${name}: longer than ${limit} bytes`);
    }
    chunks.push(value);
    onBytes(value.length);
  }
  const bytes = new Uint8Array(length);
  let at = 0;
  for (const chunk of chunks) {
    bytes.set(chunk, at);
    at += chunk.length;
  }
  return bytes;
}

export function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}
