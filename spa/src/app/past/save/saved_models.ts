import { BundleError, fetchBytes, fileUrl, isRecord, parseManifest } from '../../../model/bundle.ts';
import { manifestAt } from '../../../model/files.ts';
import { readManifest } from '../../../model/manifest.ts';
import type { ModelFile, SavedModels } from '../../../past/save/saved_span.ts';

const MANIFEST_BYTES_MAX = 4_000_000;
const FILE_BYTES_MAX = 128_000_000;
const FILES_MAX = 4096;
const PATH_MAX = 200; // characters
/** Same rule as in the relay: a relative path that can't leave the model's folder. */
const PATH = /^(?!\.{1,2}(\/|$))[\w@+=,~.-][\w @+=,~.-]*(\/(?!\.{1,2}(\/|$))[\w@+=,~.-][\w @+=,~.-]*)*$/;

/** The address of a model's manifest, by its hash. */
export type ManifestUrl = (sha256: string) => string;

/** A robot's models, loaded from the same place as its body. */
export function savedModels(manifestUrl: ManifestUrl, signal: AbortSignal): SavedModels {
  const get = (url: string, limit: number) => fetchBytes(url, limit, signal, () => {});
  return {
    manifest: async (sha256) => {
      const raw = await manifestAt(manifestUrl(sha256));
      return raw.v === 2 ? readManifest(raw) : null;
    },
    files: async (sha256) => {
      const url = manifestUrl(sha256);
      const manifest = await get(url, MANIFEST_BYTES_MAX);
      const raw = parseManifest(new TextDecoder().decode(manifest));
      const listed = Array.isArray(raw.files) ? raw.files.slice(0, FILES_MAX) : [];
      const files = listed.flatMap((entry): ModelFile[] => {
        if (!isRecord(entry)) return [];
        const { path, size } = entry;
        if (typeof path !== 'string' || path.length > PATH_MAX || !PATH.test(path)) return [];
        if (typeof size !== 'number') return [];
        const fetch = async () => {
          const bytes = await get(fileUrl(url, { path }), FILE_BYTES_MAX);
          if (bytes.length !== size)
            throw new BundleError(`${path}: ${bytes.length} bytes instead of ${size}`);
          return bytes;
        };
        return [{ path, bytes: size, fetch }];
      });
      const first = { path: 'manifest.json', bytes: manifest.length, fetch: async () => manifest };
      return [first, ...files.filter(({ path }) => path !== first.path)];
    },
  };
}
