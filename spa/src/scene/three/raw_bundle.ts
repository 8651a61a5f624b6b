import {
  BundleError,
  type BundleFile,
  fetchBytes,
  fileUrl,
  isRecord,
  type RawManifest,
} from '../../model/bundle.ts';

/** Larger files are refused: the edge does not send them either, and they would not fit into a phone's memory. */
const MAX_FILE_BYTES = 128_000_000;
const MAX_BUNDLE_BYTES = 512_000_000;
/** Files fetched at once: the number of connections that browsers open to a host over HTTP/1.1. */
const PARALLEL = 6;

/** Reads a manifest of version 1. Throws a BundleError that says what is wrong with it. */
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
  if (total > MAX_BUNDLE_BYTES) throw new BundleError(`model manifest: too many bytes, ${total}`);
  if (urdf === undefined) throw new BundleError('model manifest: its files include no URDF');
  const missing = Array.isArray(raw.missing) ? raw.missing.filter((uri) => typeof uri === 'string') : [];
  return { urdf, files, missing: new Set(missing) };
}

function parseFile(entry: unknown, index: number): BundleFile {
  const where = `model manifest: file ${index}`;
  if (!isRecord(entry)) throw new BundleError(`${where} is not an object`);
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

/** Fetches a bundle's files, six at a time, and reports the total bytes received. */
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

  /** The file's bytes. Rejects with BundleError if it can't be fetched or its size differs from the manifest. */
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
