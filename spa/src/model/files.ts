import { BundleError, fetchBytes, fetchManifest, fileUrl } from './bundle.ts';
import { type LodFile, type Manifest, readManifest } from './manifest.ts';

/**
 * Caches levels by the SHA-256 of their bytes, so that the same meshes are fetched once, whatever robot or relay they come from.
 * It uses the browser's Cache API, up to `MAX_BYTES`; the oldest are dropped. Pages without that API (neither https nor
 * localhost) still benefit from the browser's HTTP cache, because the files are served as immutable.
 */

const NAME = 'posecast-levels-1';
const MAX_BYTES = 64_000_000;

const address = (sha256: string) => `/.posecast-levels/${sha256}`;

/** The bytes of a level that this browser keeps; null when it has none. */
async function cachedLod(sha256: string): Promise<Uint8Array | null> {
  try {
    const found = await (await globalThis.caches?.open(NAME))?.match(address(sha256));
    return found === undefined ? null : new Uint8Array(await found.arrayBuffer());
  } catch {
    return null; // a private window may deny the cache; the level is then fetched
  }
}

/** Keeps the bytes of a level, and drops the oldest ones beyond `MAX_BYTES`. Never rejects. */
async function storeLod(sha256: string, bytes: Uint8Array): Promise<void> {
  try {
    const cache = await globalThis.caches?.open(NAME);
    if (cache === undefined || bytes.length > MAX_BYTES) return;
    await cache.put(
      address(sha256),
      new Response(bytes as Uint8Array<ArrayBuffer>, { headers: { 'content-length': String(bytes.length) } }),
    );
    let total = 0;
    for (const key of [...(await cache.keys())].reverse()) {
      total += Number((await cache.match(key))?.headers.get('content-length') ?? 0);
      if (total > MAX_BYTES) await cache.delete(key);
    }
  } catch {
    // no room, or not allowed: as above
  }
}

/** Whether the bytes have this SHA-256; null if the browser can't compute it (no https). */
async function matchesHash(sha256: string, bytes: Uint8Array): Promise<boolean | null> {
  if (globalThis.crypto?.subtle === undefined) return null;
  const digest = new Uint8Array(
    await globalThis.crypto.subtle.digest('SHA-256', bytes as Uint8Array<ArrayBuffer>),
  );
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, '0')).join('') === sha256;
}

/**
 * The files of a built model (manifest version 2), each fetched once and shared. The page starts fetching as soon as it knows
 * their names; the drawing code, which loads later over the same line, picks them up here.
 */

type RawManifest = Readonly<Record<string, unknown>>;

/** Entries kept of each kind: a page shows one robot, and a newer model may already be on its way. */
const KEPT = 2;
const manifests = new Map<string, Promise<RawManifest>>();
const levels = new Map<string, ComingLevel>();
/** Hashes that were already requested; they are not prefetched again. */
const asked = new Set<string>();

/** The manifest at `url`, of any version. Rejects with a one-line BundleError; the next call then tries again. */
export function manifestAt(url: string): Promise<RawManifest> {
  let coming = manifests.get(url);
  if (coming === undefined) {
    coming = fetchManifest(url, new AbortController().signal);
    coming.catch(() => manifests.delete(url));
    keep(manifests, url, coming);
  }
  return coming;
}

/** The manifest at `url` if it is for a built model, else null. Also starts to fetch its coarsest level. Rejects like
 *  `manifestAt`, and if the manifest is invalid. */
export async function builtModelAt(url: string): Promise<Manifest | null> {
  const raw = await manifestAt(url);
  if (raw.v !== 2) return null;
  const manifest = readManifest(raw);
  const [coarsest] = manifest.levels;
  if (coarsest !== undefined && !asked.has(coarsest.sha256)) {
    asked.add(coarsest.sha256);
    fetchAhead(coarsest, url);
  }
  return manifest;
}

/** Prefetches a level. An error is reported to the later `lodBytes` call. */
function fetchAhead(file: LodFile, manifestUrl: string): void {
  if (levels.has(file.sha256)) return;
  const coming = new ComingLevel(file, manifestUrl);
  coming.bytes.catch(() => {});
  keep(levels, file.sha256, coming)?.abort();
}

/**
 * A level's bytes from this browser's cache or the network, checked by size and, where the browser can, by hash.
 * `onBytes` gets the number received so far. Rejects with a one-line BundleError that names the file.
 */
export async function lodBytes(
  file: LodFile,
  manifestUrl: string,
  signal: AbortSignal,
  onBytes: (received: number) => void,
): Promise<Uint8Array> {
  const coming = levels.get(file.sha256) ?? new ComingLevel(file, manifestUrl);
  levels.delete(file.sha256); // the caller keeps the bytes
  asked.add(file.sha256);
  coming.onBytes = onBytes;
  onBytes(coming.received);
  const leave = () => coming.abort();
  if (signal.aborted) leave();
  signal.addEventListener('abort', leave, { once: true });
  try {
    return await coming.bytes;
  } finally {
    signal.removeEventListener('abort', leave);
  }
}

class ComingLevel {
  readonly bytes: Promise<Uint8Array>;
  received = 0;
  onBytes: (received: number) => void = () => {};
  readonly #leave = new AbortController();

  constructor(file: LodFile, manifestUrl: string) {
    this.bytes = this.#get(file, manifestUrl);
  }

  abort(): void {
    this.#leave.abort();
  }

  async #get({ path, bytes: size, sha256 }: LodFile, manifestUrl: string): Promise<Uint8Array> {
    const known = await cachedLod(sha256);
    if (known?.length === size) {
      this.#hear(size);
      return known;
    }
    const url = fileUrl(manifestUrl, { path });
    const bytes = await fetchBytes(url, size, this.#leave.signal, (more) => this.#hear(more));
    if (bytes.length !== size) throw new BundleError(`${path}: ${bytes.length} bytes instead of ${size}`);
    if ((await matchesHash(sha256, bytes)) === false) {
      throw new BundleError(`${path}: its SHA-256 does not match`);
    }
    void storeLod(sha256, bytes);
    return bytes;
  }

  #hear(more: number): void {
    this.received += more;
    this.onBytes(this.received);
  }
}

/** Adds an entry; beyond `KEPT` the oldest is removed and returned. */
function keep<T>(map: Map<string, T>, name: string, value: T): T | undefined {
  map.set(name, value);
  const [oldest] = map.keys();
  if (map.size <= KEPT || oldest === undefined) return undefined;
  const gone = map.get(oldest);
  map.delete(oldest);
  return gone;
}
