import { Decoder, type Frame, FrameError, type Schema, SchemaError } from '@posecast/wire';
import { poseDiffers } from '../../twin/pose_change.ts';
import type { RobotState } from '../../twin/robot.ts';
import type { ShownFrame } from '../lane_port.ts';
import type { FromStream } from '../messages.ts';
import { ShownFrames } from './shown_frames.ts';

/** After a longer pause between frames, the pose may have moved meanwhile, so it counts as changed. */
const GAP_MS = 2500;

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
  readonly #decoder = new Decoder();
  readonly #shown: ShownFrames;
  #schema: Schema | null = null;
  #newest: { readonly schema: Schema; readonly codes: Int32Array; readonly atMs: number } | null = null;
  #changedMs = 0;
  /** The newest frame that may be shown and has not been; null: none. */
  #state: RobotState | null = null;

  constructor(before: ShownFrame | null) {
    this.#shown = new ShownFrames(before);
  }

  /** Takes a schema's text. Returns what is wrong with it; null: nothing. */
  addSchema(text: string): string | null {
    try {
      this.#decoder.addSchema(text);
      return null;
    } catch (error) {
      if (error instanceof SchemaError) return error.message;
      throw error;
    }
  }

  /** Takes an earlier KEY, which the next frames refer to. */
  addCopy(bytes: Uint8Array): void {
    this.#decode(bytes);
  }

  /** Takes a frame. Returns whether to show it. `isFound`: see `ShownFrames.show`. */
  addFrame({ bytes, runId, acceptedMs, liveMs, atMs, lateMs }: DueFrame, isFound: boolean): boolean {
    const frame = this.#decode(bytes);
    if (frame === null) return false;
    const { schema, seq, tS, codes } = frame;
    const named = { runId, schemaId: schema.id, seq, tS, atMs: acceptedMs, liveMs };
    if (!this.#shown.show(named, isFound)) return false;
    const before = this.#newest;
    const unsure = before?.schema.id !== schema.id || atMs - before.atMs > GAP_MS;
    if (unsure || poseDiffers(schema, before.codes, codes)) this.#changedMs = atMs;
    this.#newest = { schema, codes, atMs };
    const bornMs = atMs - lateMs;
    this.#state = {
      ...{ schemaId: schema.id, seq, tS, codes: codes.slice() },
      ...{ freshMs: bornMs, bornMs, changedMs: this.#changedMs, atMs, lateMs },
    };
    return true;
  }

  /** Posts the newest frame if it has not been shown, preceded by its schema if the page does not have it. */
  post(to: (message: FromStream) => void): void {
    const [state, schema] = [this.#state, this.#newest?.schema ?? null];
    if (state === null || schema === null) return;
    if (this.#schema?.id !== schema.id) to({ kind: 'schema', schema });
    this.#schema = schema;
    this.#state = null;
    to({ kind: 'state', state });
  }

  /** An unreadable frame is skipped: the next part does not depend on it. */
  #decode(bytes: Uint8Array): Frame | null {
    try {
      return this.#decoder.decode(bytes);
    } catch (error) {
      if (error instanceof FrameError) return null;
      throw error;
    }
  }
}
