import { readAtMost } from '../kit.ts';
import { request } from '../relay/request.ts';
import { tokenFor } from '../relay/token.ts';

/**
 * Loads a robot's bundle over HTTP: the manifest names every file, and the scene fetches those it needs.
 *
 * Version 1, the raw bundle: `{"v":1,"urdf":"robot.urdf","files":[{"path","uri","size",…}],"missing":["package://…"]}`.
 * `uri` is the exact string that the URDF uses, so nothing has to be resolved here.
 */

const MAX_MANIFEST_BYTES = 4_000_000;

/** A model that can't be loaded; the message is one line. */
export class BundleError extends Error {}

/** A file failed to load for a temporary reason: no answer, or an overloaded server. */
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
  /** URIs that the edge knows to have no file. */
  missing: ReadonlySet<string>;
}

/** The source of a raw bundle's files: a relay, or files that somebody dropped on the page. */
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
  if (!isRecord(raw)) throw new BundleError('model manifest: not an object');
  return raw;
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

/** Reads a file by its path, at most `most` bytes. Rejects if it does not exist. */
export type ReadFile = (path: string, most: number) => Promise<Uint8Array>;

/** Readers for files that are not on a server, by the prefix of their addresses. */
const readers = new Map<string, ReadFile>();

/** Serves files whose address begins with `folder` through `read` instead of fetching them. Returns a function that ends this. */
export function serveFolder(folder: string, read: ReadFile): () => void {
  readers.set(folder, read);
  return () => void readers.delete(folder);
}

/** Fetches `url`, with a token if there is one for it. `onBytes` gets the size of each piece. Rejects with BundleError if it
 *  fails or the file exceeds `limit` bytes. */
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
      throw new BundleError(`${name}: not found`, { cause });
    });
    onBytes(bytes.length);
    return bytes;
  }
  let response: Response;
  try {
    const token = tokenFor(url);
    const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
    response = await request(url, { signal, headers });
  } catch (cause) {
    throw new NotNow(`${name}: no answer`, { cause });
  }
  if (!response.ok) {
    const Refusal = response.status >= 500 || response.status === 429 ? NotNow : BundleError;
    throw new Refusal(`${name}: answered ${response.status}`);
  }
  const bytes = await readAtMost(response.body, limit, onBytes).catch((cause: unknown) => {
    throw new NotNow(`${name}: the answer broke off`, { cause });
  });
  if (bytes === null) throw new BundleError(`${name}: longer than ${limit} bytes`);
  return bytes;
}

/** Whether an error means that something failed to load for a temporary reason. */
export function isPassing(cause: unknown): boolean {
  return (
    cause instanceof NotNow || (cause instanceof Error && cause.cause !== undefined && isPassing(cause.cause))
  );
}

export function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}
