/** What a segment holds (SPEC §10), and its bounds. */

import type { RobotStatus } from '../messages.ts';

export const SEGMENT = { magic: [0x89, 0x50, 0x43, 0x53], version: 1, what: 'segment' };
export const PREFIX_BYTES = 9;
export const CRC_BYTES = 4;
export const TAIL_BYTES = 9;
export const HEADER_BYTES_MAX = 1 << 20;
export const RECORDS_BYTES_MAX = 1 << 20;
export const ENVELOPE_BYTES_MAX =
  PREFIX_BYTES + HEADER_BYTES_MAX + CRC_BYTES + RECORDS_BYTES_MAX + TAIL_BYTES;
export const DURATION_MS_MAX = 600_000;
export const INFO_BYTES_MAX = 1 << 17;
export const EVENT_BYTES_MAX = 4096;
export const NUMBERING_BYTES_MAX = 256;
export const OPEN_FAULTS_MAX = 100;
export const NAME_BYTES_MAX = 63;
export const HASH_BYTES = 32;
export const U32_MAX = 0xffff_ffff;
export const FROM_MS_MAX = Number.MAX_SAFE_INTEGER - DURATION_MS_MAX;
export const NAME = /^[a-z0-9][a-z0-9-]{0,62}$/;
export const WORDS: readonly RobotStatus[] = ['online', 'silent', 'offline'];
export const KINDS = ['end', 'frame', 'copy', 'event', 'info', 'model', 'word'] as const;

/** A segment that can't be read or written: one line, `where: reason`. */
export class SegmentError extends Error {
  override readonly name = 'SegmentError';
}

export function refuse(where: string, reason: string): never {
  throw new SegmentError(`${where}: ${reason}`);
}

/**
 * What is known of a segment when it begins; word, model, info and open faults are as they were then. `take`,
 * `runId`: 16 hexadecimal digits, since a number is exact only up to 2^53; a run of zeros: none was known. `fromMs`:
 * unix, rounded down. `schema`, `model`: SHA-256 of schema text and manifest, hexadecimal. `missing`: frames of the
 * run lost between the segments before in this take and this one. `numbering` names the count of the events' numbers,
 * of which `eventN` is the newest before this segment; 0: none. `openFaults`: texts of events that had begun and not
 * ended, oldest first.
 */
export interface SegmentStart {
  readonly robot: string;
  readonly view: string;
  readonly take: string;
  readonly index: number;
  readonly runId: string;
  readonly fromMs: number;
  readonly schema: string | null;
  readonly model: string | null;
  readonly word: RobotStatus;
  readonly missing: number;
  readonly numbering: string;
  readonly eventN: number;
  readonly info: ReadonlyMap<string, string>;
  readonly openFaults: readonly string[];
}

/**
 * Something that was accepted. `atUs`: when, µs since the segment's `fromMs`. A `frame` that was `lateUs` late then; a
 * `copy` of a KEY of before, which frames here name as their base; an `event` as every viewer got it
 * (`parseRelayMessage` reads it); or what info, model or the robot's status changed to.
 */
export type SegmentRecord =
  | {
      readonly kind: 'frame';
      readonly atUs: number;
      readonly lateUs: number;
      readonly seq: number;
      readonly frame: Uint8Array;
    }
  | { readonly kind: 'copy'; readonly atUs: number; readonly frame: Uint8Array }
  | { readonly kind: 'event'; readonly atUs: number; readonly text: string }
  | { readonly kind: 'info'; readonly atUs: number; readonly info: ReadonlyMap<string, string> }
  | { readonly kind: 'model'; readonly atUs: number; readonly model: string | null }
  | { readonly kind: 'word'; readonly atUs: number; readonly word: RobotStatus };

/** A whole segment: its records in the order in which the relay accepted what they hold. `toMs`: unix, rounded down. */
export interface Segment {
  readonly start: SegmentStart;
  readonly toMs: number;
  readonly records: readonly SegmentRecord[];
}
