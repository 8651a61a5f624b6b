/** Reads `recording.json`. What breaks a rule of SPEC §12 is refused whole, with one line: what and where. */

import { isObject, parseJson } from '../checked.ts';
import { type EventMessage, parseRelayMessage } from '../messages.ts';
import { SCHEMA_BYTES_MAX } from '../schema_parser.ts';
import { DURATION_MS_MAX, ENVELOPE_BYTES_MAX, NAME, U32_MAX, WORDS } from '../segment/segment.ts';
import {
  FORMAT,
  HASHES_MAX,
  NOTE_CHARACTERS_MAX,
  NOTES_MAX,
  type PastRecording,
  RECORDING_BYTES_MAX,
  RECORDING_VERSION,
  type RecordedEvent,
  type RecordedSegment,
  type RecordedWord,
  type RecordingNote,
  refuse,
  SEGMENTS_MAX,
  STATES_MAX,
  TIME_MS_MAX,
  TIME_MS_MIN,
  TITLE_CHARACTERS_MAX,
} from './recording.ts';

const SEGMENT_VALUES = 11; // of a row
const STATE_VALUES = 3;
const UTF8 = new TextDecoder('utf-8', { fatal: true, ignoreBOM: true });
const TO_UTF8 = new TextEncoder();
const CONTROLS = /\p{Cc}/u;
const NOTE_CONTROLS = /(?![\t\n])\p{Cc}/u;
const U64_DIGITS = /^[0-9a-f]{16}$/;
const SHA256_DIGITS = /^[0-9a-f]{64}$/;
const NO_RUN = '0'.repeat(16);

type Members = ReadonlyMap<string, unknown>;
type Row = readonly unknown[];
type Take = readonly [take: string, runId: string];

/** A segment whose words and events are yet to come. */
type OpenSegment = Omit<RecordedSegment, 'words' | 'events'> & {
  readonly words: RecordedWord[];
  readonly events: RecordedEvent[];
};

/** Reads `recording.json`. Unknown members are ignored. RecordingError when it is none. */
export function decodeRecording(data: Uint8Array): PastRecording {
  if (data.length > RECORDING_BYTES_MAX)
    refuse('recording', `${data.length} bytes, ${RECORDING_BYTES_MAX} allowed`);
  const members = object(documentOf(data), 'recording');
  if (members.get('format') !== FORMAT) refuse('format', `must be ${FORMAT}`);
  if (whole(members.get('version'), 'version', 1) > RECORDING_VERSION)
    refuse('version', 'made by a newer Posecast');
  return read(members);
}

/** What a recorded event says; null where this reader does not know it, since a newer relay may say more. */
export function eventOf({ event }: RecordedEvent): EventMessage | null {
  const message = parseRelayMessage(JSON.stringify(event));
  return message?.type === 'event' ? message : null;
}

function documentOf(data: Uint8Array): unknown {
  try {
    return parseJson(UTF8.decode(data));
  } catch {
    return refuse('recording', 'not JSON');
  }
}

/** Reads the members, in the order in which both languages look at them. */
function read(members: Members): PastRecording {
  const robot = name(members.get('robot'), 'robot');
  const view = name(members.get('view'), 'view');
  const title = heading(members.get('title'), 'title');
  const author = heading(members.get('author'), 'author');
  const licence = heading(members.get('licence'), 'licence');
  const fromMs = whole(members.get('from_ms'), 'from_ms', TIME_MS_MIN, TIME_MS_MAX);
  const toMs = whole(members.get('to_ms'), 'to_ms', fromMs, TIME_MS_MAX);
  const notes = readNotes(members, fromMs, toMs);
  const schemas = readSchemas(members);
  const models = readModels(members);
  const takes = readTakes(members);
  const segments = readSegments(members, { fromMs, toMs, takes, schemas: [...schemas.keys()], models });
  for (const [where, segment, atMs, value] of states(members, 'words', segments, fromMs)) {
    const word = WORDS.find((one) => one === value) ?? refuse(where, `must be one of ${WORDS.join(', ')}`);
    segment.words.push({ atMs, word });
  }
  for (const [where, segment, atMs, event] of states(members, 'events', segments, fromMs)) {
    if (!isObject(event)) refuse(where, 'must be an object');
    segment.events.push({ atMs, event: event as Readonly<Record<string, unknown>> });
  }
  return { robot, view, title, author, licence, fromMs, toMs, notes, schemas, models, segments };
}

function readNotes(members: Members, fromMs: number, toMs: number): RecordingNote[] {
  let leastMs = fromMs;
  return items(members.get('notes'), 'notes', NOTES_MAX).map((value, i) => {
    const where = `notes[${i}]`;
    const note = object(value, where);
    const atMs = whole(note.get('at_ms'), `${where}.at_ms`, fromMs, toMs);
    if (atMs < leastMs) refuse(where, 'out of order');
    leastMs = atMs;
    return { atMs, text: noteText(note.get('text'), `${where}.text`) };
  });
}

function readSchemas(members: Members): Map<string, string> {
  const schemas = new Map<string, string>();
  for (const [i, value] of items(members.get('schemas'), 'schemas', HASHES_MAX).entries()) {
    const where = `schemas[${i}]`;
    const schema = object(value, where);
    const sha256 = sha256Of(schema.get('sha256'), `${where}.sha256`);
    if (schemas.has(sha256)) refuse(`${where}.sha256`, 'appears twice');
    const text = schema.get('text');
    if (typeof text !== 'string' || text === '' || !isWithin(text, SCHEMA_BYTES_MAX))
      refuse(`${where}.text`, `must be a text of 1 to ${SCHEMA_BYTES_MAX} bytes`);
    schemas.set(sha256, text);
  }
  return schemas;
}

/** A character of UTF-16 takes one byte or more: only what may be short enough is encoded. */
function isWithin(text: string, bytesMax: number): boolean {
  return text.length <= bytesMax && TO_UTF8.encode(text).length <= bytesMax;
}

function readModels(members: Members): string[] {
  const models = new Set<string>();
  for (const [i, value] of items(members.get('models'), 'models', HASHES_MAX).entries()) {
    const sha256 = sha256Of(value, `models[${i}]`);
    if (models.has(sha256)) refuse(`models[${i}]`, 'appears twice');
    models.add(sha256);
  }
  return [...models];
}

function readTakes(members: Members): Take[] {
  const takes = new Map<string, string>();
  for (const [i, value] of items(members.get('takes'), 'takes', SEGMENTS_MAX).entries()) {
    const where = `takes[${i}]`;
    const row = object(value, where);
    const take = u64(row.get('take'), `${where}.take`);
    if (takes.has(take)) refuse(`${where}.take`, 'appears twice');
    takes.set(take, u64(row.get('run'), `${where}.run`));
  }
  return [...takes];
}

interface Rows {
  readonly fromMs: number;
  readonly toMs: number;
  readonly takes: readonly Take[];
  readonly schemas: readonly string[];
  readonly models: readonly string[];
}

function readSegments(members: Members, rows: Rows): OpenSegment[] {
  const segments: OpenSegment[] = [];
  const names = new Set<string>();
  for (const [i, value] of items(members.get('segments'), 'segments', SEGMENTS_MAX).entries()) {
    const where = `segments[${i}]`;
    const segment = readSegment(row(value, where, SEGMENT_VALUES), where, rows);
    const before = segments.at(-1);
    if (before && inOrder(before, segment) >= 0) refuse(where, 'out of order');
    const called = `${segment.take} ${segment.index}`;
    if (names.has(called)) refuse(where, 'a segment twice');
    names.add(called);
    segments.push(segment);
  }
  if (segments.length === 0) refuse('segments', 'there are none');
  return segments;
}

function readSegment(values: Row, where: string, rows: Rows): OpenSegment {
  const [take, runId] = ofRows(rows.takes, values[0], `${where}: take`);
  const index = whole(values[1], `${where}: index`, 0, U32_MAX);
  const fromMs = rows.fromMs + whole(values[2], `${where}: from`, 0, rows.toMs - rows.fromMs);
  const leftMs = Math.min(DURATION_MS_MAX, rows.toMs - fromMs);
  const toMs = fromMs + whole(values[3], `${where}: duration`, 0, leftMs);
  const frames = whole(values[4], `${where}: frames`, 0, U32_MAX);
  const firstSeq = whole(values[5], `${where}: first seq`, 0, U32_MAX);
  const lastSeq = whole(values[6], `${where}: last seq`, 0, U32_MAX);
  const bytes = whole(values[7], `${where}: bytes`, 1, ENVELOPE_BYTES_MAX);
  const schema = values[8] === null ? null : ofRows(rows.schemas, values[8], `${where}: schema`);
  const model = values[9] === null ? null : ofRows(rows.models, values[9], `${where}: model`);
  const missing = whole(values[10], `${where}: missing`, 0, U32_MAX);
  if (frames > 0 && (schema === null || runId === NO_RUN)) refuse(where, 'frames without a schema or run');
  const numbers = { fromMs, toMs, frames, firstSeq, lastSeq, bytes };
  return { take, runId, index, ...numbers, schema, model, missing, words: [], events: [] };
}

/** By beginning, then take, then index. */
function inOrder(a: OpenSegment, b: OpenSegment): number {
  if (a.fromMs !== b.fromMs) return a.fromMs - b.fromMs;
  if (a.take !== b.take) return a.take < b.take ? -1 : 1;
  return a.index - b.index;
}

/** Where each stands, its segment, its moment (unix ms), and what it says. */
function* states(
  members: Members,
  list: 'words' | 'events',
  segments: readonly OpenSegment[],
  fromMs: number,
): Generator<[where: string, segment: OpenSegment, atMs: number, value: unknown]> {
  let [newestRow, newestMs] = [-1, -1];
  for (const [i, value] of items(members.get(list), list, STATES_MAX).entries()) {
    const where = `${list}[${i}]`;
    const values = row(value, where, STATE_VALUES);
    const at = rowOf(segments.length, values[0], `${where}: segment`);
    const segment = segments[at]!;
    const offsetMs = whole(values[1], `${where}: at`, segment.fromMs - fromMs, segment.toMs - fromMs);
    if (at < newestRow || (at === newestRow && offsetMs < newestMs)) refuse(where, 'out of order');
    [newestRow, newestMs] = [at, offsetMs];
    yield [where, segment, fromMs + offsetMs, values[2]];
  }
}

function object(value: unknown, where: string): Members {
  if (!isObject(value)) refuse(where, 'must be an object');
  return new Map(Object.entries(value));
}

/** A list, empty where there is none. */
function items(value: unknown, where: string, most: number): readonly unknown[] {
  if (value === undefined || value === null) return [];
  if (!Array.isArray(value)) refuse(where, 'must be a list');
  if (value.length > most) refuse(where, `${value.length}, ${most} allowed`);
  return value;
}

/** A row. A later writer may add values behind those that are known. */
function row(value: unknown, where: string, count: number): Row {
  if (!Array.isArray(value) || value.length < count) refuse(where, `must be a list of ${count}`);
  return value;
}

function whole(value: unknown, where: string, low: number, high = Number.MAX_SAFE_INTEGER): number {
  if (!Number.isInteger(value) || (value as number) < low || (value as number) > high)
    refuse(where, `must be a whole number from ${low} to ${high}`);
  return (value as number) + 0; // no −0
}

function rowOf(count: number, value: unknown, where: string): number {
  const at = whole(value, where, 0);
  if (at >= count) refuse(where, `row ${at} of ${count}`);
  return at;
}

function ofRows<T>(rows: readonly T[], value: unknown, where: string): T {
  return rows[rowOf(rows.length, value, where)]!;
}

function u64(value: unknown, where: string): string {
  if (typeof value !== 'string' || !U64_DIGITS.test(value))
    refuse(where, 'must be 16 lower-case hexadecimal digits');
  return value;
}

function sha256Of(value: unknown, where: string): string {
  if (typeof value !== 'string' || !SHA256_DIGITS.test(value))
    refuse(where, 'must be 64 lower-case hexadecimal digits');
  return value;
}

function name(value: unknown, where: string): string {
  if (typeof value !== 'string' || !NAME.test(value))
    refuse(where, 'use 1 to 63 of a-z, 0-9 and -, not starting with -');
  return value;
}

function heading(value: unknown, where: string): string | null {
  if (value === undefined || value === null) return null;
  if (typeof value !== 'string' || !isShort(value, TITLE_CHARACTERS_MAX) || CONTROLS.test(value))
    refuse(where, `must be a text of 1 to ${TITLE_CHARACTERS_MAX} characters without control characters`);
  return value;
}

function noteText(value: unknown, where: string): string {
  if (typeof value !== 'string' || !isShort(value, NOTE_CHARACTERS_MAX) || NOTE_CONTROLS.test(value)) {
    const reason = 'characters without control characters, except line ends and tabs';
    refuse(where, `must be a text of 1 to ${NOTE_CHARACTERS_MAX} ${reason}`);
  }
  return value;
}

/** A character takes one or two units of a string: only what may be short enough is counted. */
function isShort(value: string, charactersMax: number): boolean {
  return value.length > 0 && value.length <= 2 * charactersMax && [...value].length <= charactersMax;
}
