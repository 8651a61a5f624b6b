import type { Manifest } from '../../model/manifest.ts';
import type { PastSource } from '../past_source.ts';

/** The longest span that is saved, ms. */
export const SPAN_MS_MAX = 600_000;
/** Bound of the segments of a span, which are held while it is saved: ten times those of ten minutes of the demo robot. */
export const SEGMENTS_BYTES_MAX = 64e6;

export type SaveFormat = 'csv' | 'mcap' | 'posecast';

/** A file of a model: its path beside the manifest, `manifest.json` being one of them, and what fetches it. */
export interface ModelFile {
  readonly path: string;
  /** As the manifest says; 0 of the manifest itself. */
  readonly bytes: number;
  /** Rejects with an Error whose message is one line. */
  fetch(): Promise<Uint8Array>;
}

/** Where models come from. All of it rejects with an Error whose message is one line. */
export interface SavedModels {
  /** The links and joints of a model; null of one that says nothing about them. */
  manifest(sha256: string): Promise<Manifest | null>;
  /** All files of a model, the manifest first. */
  files(sha256: string): Promise<readonly ModelFile[]>;
}

/** What saving needs of the page. */
export interface SavePorts {
  readonly source: Pick<PastSource, 'loadIndex' | 'segmentsIn' | 'segmentBytes' | 'schema'>;
  readonly models: SavedModels;
  /** Lets the page draw and answer. */
  readonly breathe: () => Promise<void>;
  readonly signal: AbortSignal;
  /** How much is done, 0…1. */
  readonly onProgress: (part: number) => void;
}

/** What a saved file lacks because it could not be had. */
export interface Lost {
  readonly segments: number;
  readonly models: number;
}

/** Why nothing was saved. `nothing`: nothing is recorded in the span, or none of it could be had. `too-long`: more than
 *  `SPAN_MS_MAX` or `SEGMENTS_BYTES_MAX`. `away`: the source does not answer. */
export class SaveError extends Error {
  override readonly name = 'SaveError';

  constructor(readonly why: 'nothing' | 'too-long' | 'away') {
    super(`not saved: ${why}`);
  }
}
