/** Where the files of a recording lie (`wire/SPEC.md`, §12): on a web server, in a dropped folder, in one file. */
export interface RecordingFiles {
  /** The bytes of a file by its path, such as `segments/8f14e45fceea167a/12.segment`. Rejects with a `PastError`: `gone`
   *  where there is none, `damaged` where it is cut or has more than `most` bytes, `away` where it may come later. */
  read(path: string, most: number, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>>;
}

export { modelPath, RECORDING_FILE } from '@posecast/wire';

/** Most bytes of each kind of file. */
export const BYTES_MAX = { index: 32 << 20, segment: 3_000_000, keys: 1 << 20, model: 64 << 20 } as const;
