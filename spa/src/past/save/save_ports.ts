import type { Manifest } from '../../model/manifest.ts';
import type { PastSource } from '../past_source.ts';

/** How many bytes are held in the page's memory; Blobs belong to the browser, which moves large ones to disk. */
const PART_BYTES = 4 << 20;

/** Builds a file: about `PART_BYTES` at a time are held here, the rest in Blobs. */
export class BlobParts {
  readonly #blobs: Blob[] = [];
  #pieces: BlobPart[] = [];
  #held = 0;

  /** Adds a copy of bytes, or text as UTF-8. */
  write(piece: Uint8Array | string): void {
    const bytes = typeof piece === 'string' ? new TextEncoder().encode(piece) : piece.slice();
    if (bytes.length === 0) return;
    this.#pieces.push(bytes as Uint8Array<ArrayBuffer>);
    this.#held += bytes.length;
    if (this.#held < PART_BYTES) return;
    this.#blobs.push(new Blob(this.#pieces));
    this.#pieces = [];
    this.#held = 0;
  }

  /** The whole file. */
  blob(type: string): Blob {
    return new Blob([...this.#blobs, ...this.#pieces], { type });
  }
}

/** The longest span that can be saved, ms. */
export const SPAN_MS_MAX = 600_000;
/** Size limit of a span's segments, which are held in memory while saving: ten times the size of ten minutes of the demo
 *  robot. */
export const SEGMENTS_BYTES_MAX = 64e6;

export type SaveFormat = 'csv' | 'posecast';

/** A file of a model: its path beside the manifest (`manifest.json` is one of them), and the function that fetches it. */
export interface ModelFile {
  readonly path: string;
  /** From the manifest; 0 for the manifest itself. */
  readonly bytes: number;
  /** Rejects with an Error whose message is one line. */
  fetch(): Promise<Uint8Array>;
}

/** The source of models. All methods reject with an Error whose message is one line. */
export interface SavedModels {
  /** The manifest of a model; null if the model has no such data. */
  manifest(sha256: string): Promise<Manifest | null>;
  /** All files of a model, the manifest first. */
  files(sha256: string): Promise<readonly ModelFile[]>;
}

/** What saving needs from the page. */
export interface SavePorts {
  readonly source: Pick<PastSource, 'loadIndex' | 'segmentsIn' | 'segmentBytes' | 'schema'>;
  readonly models: SavedModels;
  /** Lets the page draw and respond. */
  readonly breathe: () => Promise<void>;
  readonly signal: AbortSignal;
  /** The progress, 0…1. */
  readonly onProgress: (part: number) => void;
}

/** What is missing in a saved file because it was unavailable. */
export interface Lost {
  readonly segments: number;
  readonly models: number;
}

/** Why nothing was saved. `nothing`: nothing is recorded in the span, or none of it was available. `too-long`: more than
 *  `SPAN_MS_MAX` or `SEGMENTS_BYTES_MAX`. `away`: the source does not answer. */
export class SaveError extends Error {
  override readonly name = 'SaveError';

  constructor(readonly why: 'nothing' | 'too-long' | 'away') {
    super(`not saved: ${why}`);
  }
}
