import { Decoder, FrameError, type MergedFrame, mergeSegments, type Schema } from '@posecast/wire';
import type { SavedSpan } from './saved_span.ts';

/** A frame in the span. `atUs`: when the relay accepted it, unix. */
export interface SavedFrame {
  readonly schema: Schema;
  readonly atUs: number;
  /** Robot time, seconds. */
  readonly tS: number;
  readonly codes: Int32Array;
}

/** The frames accepted in a span, each once: within a run by number, between runs by time. Undecodable frames are skipped, as in
 *  live. `onPart` receives the progress, 0…1. */
export function* framesOf(span: SavedSpan, onPart: (part: number) => void = () => {}): Generator<SavedFrame> {
  const { frames } = mergeSegments(span.segments.map(({ segment }) => segment));
  const heads = runsOf(frames).map((run) => ({ run, at: 0, decoders: new Map<string, SchemaReader>() }));
  for (let done = 0; done < frames.length; ) {
    const [first] = heads.filter(({ run, at }) => at < run.length).sort((a, b) => headMs(a) - headMs(b));
    const { run, at, decoders } = first!;
    const { schema: sha256, atMs, copies, frame } = run[at]!;
    first!.at += 1;
    onPart(++done / frames.length);
    const reader = decoders.get(sha256) ?? readerOf(span.schemas.get(sha256)!);
    decoders.set(sha256, reader);
    const decoded = decode(reader.decoder, [...copies, frame]);
    const atUs = Math.round(atMs * 1000);
    if (decoded === null || !isWithin(span, atUs)) continue;
    yield { schema: reader.schema, atUs, tS: decoded.tS, codes: decoded.codes };
  }
}

/** The robot's model over time: unix µs and the manifest's hash, oldest first. */
export function modelsOf({
  segments,
}: SavedSpan): { readonly atUs: number; readonly model: string | null }[] {
  const found: { atUs: number; model: string | null }[] = [];
  for (const { segment } of segments) {
    const { start, records } = segment;
    found.push({ atUs: start.fromMs * 1000, model: start.model });
    for (const record of records)
      if (record.kind === 'model')
        found.push({ atUs: start.fromMs * 1000 + record.atUs, model: record.model });
  }
  return found.sort((a, b) => a.atUs - b.atUs);
}

interface SchemaReader {
  readonly schema: Schema;
  readonly decoder: Decoder;
}

function runsOf(frames: readonly MergedFrame[]): MergedFrame[][] {
  const runs = new Map<string, MergedFrame[]>();
  for (const frame of frames) {
    const run = runs.get(frame.runId) ?? [];
    runs.set(frame.runId, run);
    run.push(frame);
  }
  return [...runs.values()];
}

function headMs({ run, at }: { readonly run: readonly MergedFrame[]; readonly at: number }): number {
  return run[at]!.atMs;
}

/** Whether a moment (unix µs) lies in a span, including its ends. */
function isWithin({ fromMs, toMs }: SavedSpan, atUs: number): boolean {
  return atUs >= fromMs * 1000 && atUs <= toMs * 1000 + 999;
}

function readerOf({ text }: Schema): SchemaReader {
  const decoder = new Decoder(1);
  return { schema: decoder.addSchema(text), decoder };
}

/** The content of the last of some frames; null if it can't be decoded. */
function decode(decoder: Decoder, frames: readonly Uint8Array[]) {
  try {
    return frames.map((frame) => decoder.decode(frame)).at(-1)!;
  } catch (error) {
    if (error instanceof FrameError) return null;
    throw error;
  }
}
