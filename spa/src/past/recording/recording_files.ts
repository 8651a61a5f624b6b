/** Storage of a recording's files (`wire/SPEC.md`, §12): a web server, a dropped folder, or a single file. */
export interface RecordingFiles {
  /** The bytes of a file by its path, such as `segments/8f14e45fceea167a/12.segment`. Rejects with a `PastError`: `gone` if it
   *  does not exist, `damaged` if it is truncated or has more than `most` bytes, `away` if it may become available later. */
  read(path: string, most: number, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>>;
}

export { modelPath, RECORDING_FILE } from '@posecast/wire';

/** Maximum size of each kind of file. */
export const BYTES_MAX = { index: 32 << 20, segment: 3_000_000, keys: 1 << 20, model: 64 << 20 } as const;
