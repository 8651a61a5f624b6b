import { tokenFor } from '../auth/token.ts';

/**
 * Loads a robot's bundle over HTTP: the manifest names every file, and the scene fetches those it needs.
 *
 * Version 1, the raw bundle: `{"v":1,"urdf":"robot.urdf","files":[{"path","uri","size",…}],"missing":["package://…"]}`.
 * `uri` is the exact string that the URDF uses, so nothing has to be resolved here.
 */

const MAX_MANIFEST_BYTES = 4_000_000;
/** Larger files are refused: the edge does not send them either, and a phone could not hold them. */
const MAX_FILE_BYTES = 128_000_000;
const MAX_BUNDLE_BYTES = 512_000_000;
/** Files fetched at once: the number of connections that browsers open to a host over HTTP/1.1. */
const PARALLEL = 6;

/** A model that can't be loaded; the message is one line. */
export class BundleError extends Error {}

/** That a file did not come, for a reason that passes: no answer, or a server that can't just now. */
export class NotNow extends BundleError {}

/** A file of a raw bundle: its path beside the manifest, the URI by which the URDF names it, and its size in bytes. */
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

/** Where a raw bundle's files come from: a relay, or files that somebody dropped on the page. */
export interface RawFiles {
  /** The file's bytes. Rejects with an Error whose message is one line. */
  fetch(file: BundleFile): Promise<Uint8Array>;
  /** A file that `file` refers to by a relative name; null when there is none. */
  beside?(file: BundleFile, name: string): Promise<Uint8Array | null>;
}

/** Parses a manifest of any version. Throws BundleError when the text is no JSON object. */
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

/** Reads a manifest of version 1. Throws BundleError that says what is wrong with it. */
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

/** Whether a path is relative and stays below the manifest's folder. */
function isInside(path: string): boolean {
  return path.split('/').every((part) => part !== '' && part !== '.' && part !== '..');
}

/** The address of a bundle's file, beside its manifest. */
export function fileUrl(manifestUrl: string, file: { readonly path: string }): string {
  return manifestUrl.replace(/[^/]*$/, '') + file.path.split('/').map(encodeURIComponent).join('/');
}

/** Fetches a manifest of any version. Rejects with BundleError. */
export async function fetchManifest(
  url: string,
  signal: AbortSignal,
): Promise<Readonly<Record<string, unknown>>> {
  return parseManifest(new TextDecoder().decode(await fetchBytes(url, MAX_MANIFEST_BYTES, signal, () => {})));
}

/** Fetches a bundle's files, six at a time, and reports the bytes received of all files together. */
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

  /** The file's bytes. Rejects with BundleError when it can't be fetched or its size differs from the manifest. */
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
      this.#count(file.size - mine); // a failed file counts as done, so that the progress bar reaches its end
      this.#running -= 1;
      this.#waiting.shift()?.();
    }
  }

  #count(more: number): void {
    this.#received += more;
    if (more !== 0 && !this.#signal.aborted) this.#onBytes(this.#received);
  }
}

/** Reads a file by its path, `most` bytes of it at most. Rejects where there is none. */
export type ReadFile = (path: string, most: number) => Promise<Uint8Array>;

/** What reads files that lie on no server, by the beginning of their addresses. */
const readers = new Map<string, ReadFile>();

/** Lets the files whose address begins with `folder` be read by `read` instead of fetched. Returns a function that ends it. */
export function serveFolder(folder: string, read: ReadFile): () => void {
  readers.set(folder, read);
  return () => void readers.delete(folder);
}

/** Fetches `url`, with a token if there is one for it. `onBytes` gets the size of each piece. Rejects with BundleError
 *  when it fails or has more than `limit` bytes. */
export async function fetchBytes(
  url: string,
  limit: number,
  signal: AbortSignal,
  onBytes: (more: number) => void,
): Promise<Uint8Array> {
  const name = url.slice(url.lastIndexOf('/') + 1);
  for (const [folder, read] of readers) {
    if (!url.startsWith(folder)) continue;
    const path = decodeURIComponent(url.slice(folder.length));
    const bytes = await read(path, limit).catch((cause: unknown) => {
      throw new BundleError(`${name}: not there`, { cause });
    });
    onBytes(bytes.length);
    return bytes;
  }
  let response: Response;
  try {
    const token = tokenFor(url);
    const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
    response = await fetch(url, { signal, credentials: 'omit', headers });
  } catch (cause) {
    throw new NotNow(`${name}: no answer`, { cause });
  }
  if (!response.ok) {
    const Refusal = response.status >= 500 || response.status === 429 ? NotNow : BundleError;
    throw new Refusal(`${name}: answered ${response.status}`);
  }
  const reader = response.body?.getReader();
  if (reader === undefined) return new Uint8Array();
  const chunks: Uint8Array[] = [];
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read().catch((cause: unknown) => {
      throw new NotNow(`${name}: the answer broke off`, { cause });
    });
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

/** Whether an error says that something did not come for a reason that passes. */
export function isPassing(cause: unknown): boolean {
  return (
    cause instanceof NotNow || (cause instanceof Error && cause.cause !== undefined && isPassing(cause.cause))
  );
}

export function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}
