/** Writes `recording.json`. */

import { decodeRecording } from './reader.ts';
import { FORMAT, type PastRecording, RECORDING_VERSION, refuse } from './recording.ts';

/** RecordingError when it could not be read again. */
export function encodeRecording(recording: PastRecording): Uint8Array {
  const { robot, view, title, author, licence, fromMs, toMs, notes, schemas, models } = recording;
  const takes = new Map<string, number>();
  const schemaRows = rowsOf(schemas.keys());
  const modelRows = rowsOf(models);
  const [segments, words, events]: unknown[][] = [[], [], []];
  for (const [at, each] of recording.segments.entries()) {
    const where = `segments[${at}]`;
    const called = `${each.take} ${each.runId}`;
    if (!takes.has(called)) takes.set(called, takes.size);
    segments!.push([
      takes.get(called),
      each.index,
      each.fromMs - fromMs,
      each.toMs - each.fromMs,
      each.frames,
      each.firstSeq,
      each.lastSeq,
      each.bytes,
      rowOf(schemaRows, each.schema, `${where}: schema`),
      rowOf(modelRows, each.model, `${where}: model`),
      each.missing,
    ]);
    for (const { atMs, word } of each.words) words!.push([at, atMs - fromMs, word]);
    for (const { atMs, event } of each.events) events!.push([at, atMs - fromMs, event]);
  }
  const doc = {
    format: FORMAT,
    version: RECORDING_VERSION,
    robot,
    view,
    title: title ?? undefined,
    author: author ?? undefined,
    licence: licence ?? undefined,
    from_ms: fromMs,
    to_ms: toMs,
    notes: notes.map(({ atMs, text }) => ({ at_ms: atMs, text })),
    schemas: [...schemas].map(([sha256, text]) => ({ sha256, text })),
    models,
    takes: [...takes.keys()].map((called) => ({ take: called.slice(0, 16), run: called.slice(17) })),
    segments,
    words,
    events,
  };
  const data = new TextEncoder().encode(JSON.stringify(doc));
  decodeRecording(data);
  return data;
}

function rowsOf(hashes: Iterable<string>): Map<string, number> {
  return new Map([...hashes].map((sha256, row) => [sha256, row]));
}

function rowOf(rows: ReadonlyMap<string, number>, sha256: string | null, where: string): number | null {
  if (sha256 === null) return null;
  return rows.get(sha256) ?? refuse(where, `${sha256} is not in the list`);
}
