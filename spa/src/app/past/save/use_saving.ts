import { useEffect, useRef, useState } from 'react';
import { LatePart } from '../../../browser/late_part.ts';
import { BundleError, fetchBytes, fileUrl, isRecord, parseManifest } from '../../../model/bundle.ts';
import { manifestAt } from '../../../model/files.ts';
import { readManifest } from '../../../model/manifest.ts';
import type { PastSource } from '../../../past/past_source.ts';
import type { Span } from '../../../past/past_types.ts';
import type { Measure, SavedFile } from '../../../past/save/save.ts';
import type { ModelFile, SavedModels, SaveFormat, SavePorts } from '../../../past/save/saved_span.ts';
import { useLatePart } from '../../shell/late.tsx';

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

/** Long enough for any browser to start reading it, ms. */
const KEPT_MS = 60_000;

/** Makes the browser save a file. */
function download(blob: Blob, name: string): void {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), KEPT_MS);
}

/** The page is blocked for at most this long at a time, ms. */
const BUSY_MS = 12;

/** Returns a function to call often during long work: now and then it yields, so that the page can draw and respond. It yields by
 *  messages, because browsers slow down timers of background pages. */
function breaths(): () => Promise<void> {
  const { port1, port2 } = new MessageChannel();
  let begunMs = performance.now();
  return async () => {
    if (performance.now() - begunMs < BUSY_MS) return;
    await new Promise<void>((resolve) => {
      port1.onmessage = () => resolve();
      port2.postMessage(null);
    });
    begunMs = performance.now();
  };
}

/** Loaded only when somebody saves. */
const SAVE = new LatePart(
  () => import('../../../past/save/save.ts'),
  () => false,
);
/** A choice that is unchanged for this long is measured, ms. */
const SETTLE_MS = 150;

export type Failure = 'nothing' | 'too-long' | 'away' | 'failed';
export type Measured = Measure | Failure | null;

/** The state: idle, in progress (0…1), done, or failed. */
export type Saving =
  | { readonly at: 'rest' }
  | { readonly at: 'work'; readonly part: number }
  | { readonly at: 'done'; readonly file: SavedFile }
  | { readonly at: 'failed'; readonly why: Failure };

/** The result that saving a span would give, once known; updated as more data arrives. `span`: null while none is chosen. */
export function useMeasure(
  source: PastSource,
  manifestUrl: ManifestUrl,
  format: SaveFormat,
  span: Span | null,
): Measured {
  const part = useLatePart(SAVE);
  const [measured, setMeasured] = useState<Measured>(null);
  const { fromMs, toMs } = span ?? { fromMs: 0, toMs: 0 };
  useEffect(() => {
    setMeasured(null);
    if (part === null || toMs === 0) return;
    const leave = new AbortController();
    const { signal } = leave;
    const models = savedModels(manifestUrl, signal);
    let untilMs = 0;
    const tell = (found: Measured) => {
      if (!signal.aborted) setMeasured(found);
    };
    const measure = async () => {
      try {
        const ports = { source: lent(source), models, breathe: breaths(), signal };
        const found = await part.measureSpan(format, { fromMs, toMs }, ports);
        untilMs = found.untilMs;
        tell(found);
      } catch (error) {
        tell(whyOf(error));
      }
    };
    const timer = setTimeout(measure, SETTLE_MS);
    const off = source.onChange(() => {
      if (untilMs > 0 && untilMs < toMs && (source.timeline?.toMs ?? 0) > untilMs) void measure();
    });
    return () => {
      clearTimeout(timer);
      off();
      leave.abort();
    };
  }, [part, source, manifestUrl, format, fromMs, toMs]);
  return measured;
}

/** Saves one file at a time. Unmounting the component cancels. */
export function useSaving(source: PastSource, manifestUrl: ManifestUrl) {
  const [saving, setSaving] = useState<Saving>({ at: 'rest' });
  const stop = useRef<AbortController | null>(null);
  const cancel = () => {
    stop.current?.abort();
    stop.current = null;
    setSaving({ at: 'rest' });
  };
  const save = async (format: SaveFormat, span: Span) => {
    const leave = new AbortController();
    const { signal } = leave;
    stop.current = leave;
    setSaving({ at: 'work', part: 0 });
    const { saveSpan } = await SAVE.load();
    let shown = 0;
    const onProgress = (part: number) => {
      if (signal.aborted || part - shown < 0.005) return;
      shown = part;
      setSaving({ at: 'work', part });
    };
    const ports = {
      source: lent(source),
      models: savedModels(manifestUrl, signal),
      breathe: breaths(),
      signal,
      onProgress,
    };
    try {
      const file = await saveSpan(format, span, ports);
      if (signal.aborted) return;
      download(file.blob, file.name);
      setSaving({ at: 'done', file });
    } catch (error) {
      if (!signal.aborted) setSaving({ at: 'failed', why: whyOf(error) });
    }
  };
  useEffect(() => () => stop.current?.abort(), []);
  return { saving, save, cancel };
}

/** The members of a source that saving needs; the source may be a class instance. */
function lent(source: PastSource): SavePorts['source'] {
  return {
    loadIndex: (span) => source.loadIndex(span),
    segmentsIn: (span) => source.segmentsIn(span),
    segmentBytes: (ref, signal) => source.segmentBytes(ref, signal),
    schema: (sha256) => source.schema(sha256),
  };
}

function whyOf(error: unknown): Failure {
  const part = SAVE.value();
  return part !== null && error instanceof part.SaveError ? error.why : 'failed';
}
