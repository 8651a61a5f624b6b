import type { Schema } from '@posecast/wire';
import type { RobotState } from '../../twin/robot.ts';
import { PoseDecoder } from '../frame_reader.ts';
import type { ShownFrame } from '../lane_port.ts';
import type { FromStream } from '../messages.ts';

/** A frame of a part at its time. `atMs`: when it is shown, viewer's clock; `lateMs`: its delay at the relay. */
export interface DueFrame {
  readonly bytes: Uint8Array;
  readonly runId: string;
  readonly acceptedMs: number;
  readonly liveMs: number;
  readonly atMs: number;
  readonly lateMs: number;
}

/** Decodes the frames of parts one after another, and keeps the newest one that may be shown. */
export class PoseReader {
  readonly #poses = new PoseDecoder();
  readonly #shown: ShownFrames;
  /** The schema that the page has. */
  #schema: Schema | null = null;
  /** The newest frame that may be shown and has not been; null: none. */
  #next: { readonly schema: Schema; readonly state: RobotState } | null = null;

  constructor(before: ShownFrame | null) {
    this.#shown = new ShownFrames(before);
  }

  /** Takes a schema's text. Returns what is wrong with it; null: nothing. */
  addSchema(text: string): string | null {
    const schema = this.#poses.addSchema(text);
    return typeof schema === 'string' ? schema : null;
  }

  /** Takes an earlier KEY, which the next frames refer to. */
  addCopy(bytes: Uint8Array): void {
    this.#poses.decode(bytes);
  }

  /** Takes a frame. Returns whether to show it. `isFound`: see `ShownFrames.show`. */
  addFrame({ bytes, runId, acceptedMs, liveMs, atMs, lateMs }: DueFrame, isFound: boolean): boolean {
    const frame = this.#poses.decode(bytes);
    if (frame === null) return false;
    const { schema, seq, tS, codes } = frame;
    const named = { runId, schemaId: schema.id, seq, tS, atMs: acceptedMs, liveMs };
    if (!this.#shown.show(named, isFound)) return false;
    this.#poses.record(frame, atMs, atMs);
    const bornMs = atMs - lateMs;
    const state = {
      ...{ schemaId: schema.id, seq, tS, codes: codes.slice() },
      ...{ freshMs: bornMs, bornMs, changedMs: this.#poses.changedMs, atMs, lateMs },
    };
    this.#next = { schema, state };
    return true;
  }

  /** Posts the newest frame if it has not been shown, preceded by its schema if the page does not have it. */
  post(to: (message: FromStream) => void): void {
    if (this.#next === null) return;
    const { schema, state } = this.#next;
    if (this.#schema?.id !== schema.id) to({ kind: 'schema', schema });
    this.#schema = schema;
    this.#next = null;
    to({ kind: 'state', state });
  }
}

/** A frame of a part. `atMs`: when the relay accepted it, unix ms; `liveMs`: by when a socket would have delivered it, viewer's
 *  clock. */
export interface PartFrame extends Omit<ShownFrame, 'atMs'> {
  readonly runId: string;
  readonly atMs: number;
  readonly liveMs: number;
}

const SEQS = 2 ** 32; // frame numbers wrap around
/** The number of earlier runs that are remembered. */
const RUNS_MAX = 16;
/** The maximum difference between the clocks of two relays. */
const CLOCKS_MS = 1000;
/** The maximum error of `liveMs`: once the lane's position is found, and before. */
const UNSURE_MS = 2000;
const UNSURE_AT_FIRST_MS = 8000;

/**
 * Decides whether a frame may be shown: no frame twice, and none older than what was shown.
 *
 * Within a lane (run, seq) decides, because each part names its run. A socket does not name it. Frames shown by a socket are
 * known by schema, number and robot time, and by their arrival. A frame of the lane is therefore new if its time is later and, as
 * long as that time is uncertain, if its number or its robot time is greater. A robot that restarted within these seconds, and
 * counts both from 0, stands still until they are over.
 */
export class ShownFrames {
  readonly #before: ShownFrame | null;
  #runId: string | null = null;
  #seq = 0;
  #atMs = 0;
  #runs: string[] = [];

  /** `before`: what was shown before this lane began. */
  constructor(before: ShownFrame | null) {
    this.#before = before;
  }

  /** Records a frame, and returns whether to show it. `isFound`: `liveMs` is exact, not just a bound. */
  show(frame: PartFrame, isFound: boolean): boolean {
    if (!this.#isNew(frame, isFound)) return false;
    if (this.#runId !== null && this.#runId !== frame.runId)
      this.#runs = [...this.#runs, this.#runId].slice(-RUNS_MAX);
    this.#runId = frame.runId;
    this.#seq = frame.seq;
    this.#atMs = frame.atMs;
    return true;
  }

  #isNew(frame: PartFrame, isFound: boolean): boolean {
    if (frame.runId === this.#runId) return isAfter(frame.seq, this.#seq);
    if (this.#runId !== null) return !this.#runs.includes(frame.runId) && frame.atMs > this.#atMs - CLOCKS_MS;
    const before = this.#before;
    if (before === null) return true;
    if (frame.liveMs <= before.atMs) return false;
    const isLater =
      isAfter(frame.seq, before.seq) || frame.tS > before.tS || frame.schemaId !== before.schemaId;
    return isLater || frame.liveMs > before.atMs + (isFound ? UNSURE_MS : UNSURE_AT_FIRST_MS);
  }
}

function isAfter(seq: number, other: number): boolean {
  const by = (seq - other + SEQS) % SEQS;
  return by > 0 && by < SEQS / 2;
}
