/**
 * Caches levels by the SHA-256 of their bytes, so that the same meshes are fetched once, whatever robot or relay they come from.
 * It uses the browser's Cache API, up to `MAX_BYTES`; the oldest are dropped. Pages without that API (neither https nor
 * localhost) still benefit from the browser's HTTP cache, because the files are served as immutable.
 */

const NAME = 'posecast-levels-1';
const MAX_BYTES = 64_000_000;

const address = (sha256: string) => `/.posecast-levels/${sha256}`;

/** The bytes of a level that this browser keeps; null when it has none. */
export async function cachedLod(sha256: string): Promise<Uint8Array | null> {
  try {
    const found = await (await globalThis.caches?.open(NAME))?.match(address(sha256));
    return found === undefined ? null : new Uint8Array(await found.arrayBuffer());
  } catch {
    return null; // a private window may deny the cache; the level is then fetched
  }
}

/** Keeps the bytes of a level, and drops the oldest ones beyond `MAX_BYTES`. Never rejects. */
export async function storeLod(sha256: string, bytes: Uint8Array): Promise<void> {
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
export async function matchesHash(sha256: string, bytes: Uint8Array): Promise<boolean | null> {
  if (globalThis.crypto?.subtle === undefined) return null;
  const digest = new Uint8Array(
    await globalThis.crypto.subtle.digest('SHA-256', bytes as Uint8Array<ArrayBuffer>),
  );
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, '0')).join('') === sha256;
}
