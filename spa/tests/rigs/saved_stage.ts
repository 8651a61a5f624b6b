import { createHash } from 'node:crypto';
import { decodeSegment, parseSchema, type Schema } from '@posecast/wire';
import { readManifest } from '../../src/model/manifest.ts';
import { PastError, type SegmentRef } from '../../src/past/past_source.ts';
import type { ModelFile, SavePorts } from '../../src/past/save/saved_span.ts';
import { refOf } from './past_recordings.ts';

export function sha256Of(data: string | Uint8Array): string {
  return createHash('sha256').update(data).digest('hex');
}

/** What saving needs, with the given segments, schemas and manifests. */
export class SavedStage implements Omit<SavePorts, 'breathe'> {
  readonly refs: readonly SegmentRef[];
  readonly leave = new AbortController();
  readonly signal = this.leave.signal;
  /** Names (`take/index`) of unavailable segments, and the reasons. */
  readonly lost = new Map<string, PastError['why']>();
  /** Paths of unavailable model files. */
  readonly lostFiles = new Set<string>();
  readonly progress: number[] = [];
  breaths = 0;
  readonly #bytes = new Map<string, Uint8Array<ArrayBuffer>>();
  readonly #schemas: ReadonlyMap<string, Schema>;
  readonly #models: ReadonlyMap<string, string>;

  constructor(segments: readonly Uint8Array[], schemas: readonly string[], models: readonly string[] = []) {
    this.refs = segments
      .map((bytes) => {
        const ref = { ...refOf(decodeSegment(bytes)), bytes: bytes.length, sha256: sha256Of(bytes) };
        this.#bytes.set(nameOf(ref), bytes.slice());
        return ref;
      })
      .sort((a, b) => a.fromMs - b.fromMs || (a.take < b.take ? -1 : 1) || a.index - b.index);
    this.#schemas = new Map(schemas.map((text) => [sha256Of(text), parseSchema(text)]));
    this.#models = new Map(models.map((text) => [sha256Of(text), text]));
  }

  readonly source: SavePorts['source'] = {
    loadIndex: () => Promise.resolve(),
    segmentsIn: ({ fromMs, toMs }) => this.refs.filter((ref) => ref.toMs >= fromMs && ref.fromMs <= toMs),
    segmentBytes: async (ref) => {
      const why = this.lost.get(nameOf(ref));
      if (why !== undefined) throw new PastError(why, 'not to be had');
      return this.#bytes.get(nameOf(ref))!;
    },
    schema: async (sha256) => {
      const schema = this.#schemas.get(sha256);
      if (schema === undefined) throw new PastError('gone', 'no such schema');
      return schema;
    },
  };

  readonly models: SavePorts['models'] = {
    manifest: async (sha256) => readManifest(JSON.parse(this.#model(sha256))),
    files: async (sha256) => {
      const text = this.#model(sha256);
      const { files } = JSON.parse(text) as { files: readonly { path: string; size: number }[] };
      const file = (path: string, bytes: number, content: string): ModelFile => ({
        path,
        bytes,
        fetch: async () => {
          if (this.lostFiles.has(path)) throw new Error(`${path}: answered 404`);
          return new TextEncoder().encode(content);
        },
      });
      return [
        file('manifest.json', 0, text),
        ...files.map(({ path, size }) => file(path, size, `of ${path}`)),
      ];
    },
  };

  readonly breathe = async (): Promise<void> => {
    this.breaths += 1;
  };

  readonly onProgress = (part: number): void => {
    this.progress.push(part);
  };

  #model(sha256: string): string {
    const text = this.#models.get(sha256);
    if (text === undefined) throw new Error('manifest.json: answered 404');
    return text;
  }
}

export function nameOf({ take, index }: Pick<SegmentRef, 'take' | 'index'>): string {
  return `${take}/${index}`;
}

export async function bytesOf(blob: Blob): Promise<Uint8Array> {
  return new Uint8Array(await blob.arrayBuffer());
}
