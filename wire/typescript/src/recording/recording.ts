/** What a recording (SPEC §12) holds, its bounds, and where its files lie. */

import type { RobotStatus } from '../messages.ts';
import type { Segment } from '../segment/segment.ts';

export const RECORDING_FILE = 'recording.json';
export const FORMAT = 'posecast-recording';
export const RECORDING_VERSION = 1;
export const RECORDING_BYTES_MAX = 32 << 20; // of recording.json
export const SEGMENTS_MAX = 200_000;
export const HASHES_MAX = 1024; // schemas, and models
export const STATES_MAX = 400_000; // words, and events
export const NOTES_MAX = 1000;
export const NOTE_CHARACTERS_MAX = 2000;
export const TITLE_CHARACTERS_MAX = 500;
export const TIME_MS_MIN = Date.UTC(2000);
export const TIME_MS_MAX = Date.UTC(2100) - 1;
const TEN_MINUTES_MS = 600_000;

/** A recording that can't be read or written: one line, `where: reason`. */
export class RecordingError extends Error {
  override readonly name = 'RecordingError';
}

export function refuse(where: string, reason: string): never {
  throw new RecordingError(`${where}: ${reason}`);
}

/** What somebody wrote about a moment, unix ms. */
export interface RecordingNote {
  readonly atMs: number;
  readonly text: string;
}

/** The robot's status from a moment on, unix ms. */
export interface RecordedWord {
  readonly atMs: number;
  readonly word: RobotStatus;
}

/** An event as every viewer got it, accepted at `atMs`, unix. `eventOf` reads it. */
export interface RecordedEvent {
  readonly atMs: number;
  readonly event: Readonly<Record<string, unknown>>;
}

/**
 * What is known of a segment without reading it. `take`, `runId`: 16 hexadecimal digits, a run of zeros: none was
 * known. `schema`, `model`: SHA-256, hexadecimal, as they were at its beginning; `missing`: frames that got lost
 * before it. Times are unix.
 */
export interface RecordedSegment {
  readonly take: string;
  readonly runId: string;
  readonly index: number;
  readonly fromMs: number;
  readonly toMs: number;
  readonly frames: number;
  readonly firstSeq: number;
  readonly lastSeq: number;
  readonly bytes: number;
  readonly schema: string | null;
  readonly model: string | null;
  readonly missing: number;
  readonly words: readonly RecordedWord[];
  readonly events: readonly RecordedEvent[];
}

/**
 * What `recording.json` says. `notes` are ascending; `schemas`: text by SHA-256; `models`: SHA-256 of each manifest;
 * `segments`: ordered by beginning, then take, then index. Times are unix.
 */
export interface PastRecording {
  readonly robot: string;
  readonly view: string;
  readonly title: string | null;
  readonly author: string | null;
  readonly licence: string | null;
  readonly fromMs: number;
  readonly toMs: number;
  readonly notes: readonly RecordingNote[];
  readonly schemas: ReadonlyMap<string, string>;
  readonly models: readonly string[];
  readonly segments: readonly RecordedSegment[];
}

/** Where a segment's file lies in a recording. */
export function segmentPath({ take, index }: Pick<RecordedSegment, 'take' | 'index'>): string {
  return `segments/${take}/${index}.segment`;
}

/** Where the page of KEYs of ten minutes lies in a recording. `atMs`: any of their moments, unix. */
export function keyPagePath(atMs: number): string {
  const from = new Date(Math.floor(atMs / TEN_MINUTES_MS) * TEN_MINUTES_MS);
  return `keys/${from.toISOString().slice(0, 16).replace(':', '-')}Z.keys`;
}

/** Where a file of a model lies in a recording. `name`: `manifest.json`, or as the manifest has it. */
export function modelPath(model: string, name: string): string {
  return `models/${model}/${name}`;
}

/** RecordingError when a segment's file is another one than its name and place say. */
export function checkSegment(
  recording: PastRecording,
  expected: RecordedSegment,
  { start }: Pick<Segment, 'start'>,
): void {
  const { robot, view } = recording;
  if (
    start.robot !== robot ||
    start.view !== view ||
    start.take !== expected.take ||
    start.index !== expected.index
  )
    refuse(
      segmentPath(expected),
      `is of ${start.robot}/${start.view}, take ${start.take}, index ${start.index}`,
    );
}
