import {
  decodeSegment,
  Encoder,
  type EventMessage,
  encodeSegment,
  parseHeader,
  parseSchema,
  type RobotStatus,
  type Schema,
  type Segment,
  type SegmentRecord,
} from '@posecast/wire';
import type { SegmentRef } from '../../src/past/past_source.ts';

/** Starts a page of the index. */
export const FROM_MS = 1_764_000_000_000;
export const RUN = '00000000000000a0';
export const TAKE = '000000000000000a';
export const SCHEMA_SHA = '5c'.repeat(32);

export function schemaOf(joints: number): Schema {
  const labels = Array.from({ length: joints }, (_, i) => `J${i}`);
  const fields = [{ name: 'pos', unit: 'rad', scale: 0.001, labels: 'joint' }];
  return parseSchema(JSON.stringify({ type: 'schema', v: 1, robot: 'r', labels: { joint: labels }, fields }));
}

export const SCHEMA = schemaOf(2);

/** A frame sent by an edge. The first code is its number. */
export interface Sent {
  readonly seq: number;
  readonly atMs: number;
  readonly tS: number;
  readonly codes: Int32Array;
  readonly frame: Uint8Array;
}

export interface Sending {
  readonly schema?: Schema;
  readonly firstSeq?: number;
  readonly everyMs?: number;
  readonly fromMs?: number;
  /** Between isolated frames, s. */
  readonly keyEveryS?: number;
}

export function sent(count: number, given: Sending = {}): Sent[] {
  const { schema = SCHEMA, firstSeq = 0, everyMs = 100, fromMs = FROM_MS, keyEveryS = 2 } = given;
  const encoder = new Encoder(schema, keyEveryS);
  return Array.from({ length: count }, (_, i) => {
    const seq = firstSeq + i;
    const tS = 50 + (i * everyMs) / 1000;
    const codes = Int32Array.from({ length: schema.size }, (_each, joint) =>
      joint === 0 ? seq : (seq * joint) % 97,
    );
    return { seq, tS, codes, atMs: fromMs + i * everyMs, frame: encoder.encode([...codes], seq, tS, tS) };
  });
}

export interface Happened {
  readonly atMs: number;
  readonly event?: EventMessage;
  readonly word?: RobotStatus;
}

export interface Recording {
  readonly take?: string;
  readonly runId?: string;
  readonly schemaSha?: string;
  readonly hears?: (frame: Sent) => boolean;
  /** The recorder's clock is ahead by this, ms. */
  readonly aheadMs?: number;
  readonly happened?: readonly Happened[];
  readonly wordBefore?: RobotStatus;
  readonly firstIndex?: number;
}

/** Segments as a recorder writes them: ended by KEYs, by time, and by the states STALE and OFFLINE. */
export function recorded(frames: readonly Sent[], recording: Recording = {}): Segment[] {
  const { take = TAKE, runId = RUN, schemaSha = SCHEMA_SHA, aheadMs = 0, happened = [] } = recording;
  const hears = recording.hears ?? (() => true);
  const segments: {
    fromMs: number;
    toMs: number;
    word: RobotStatus;
    faults: string[];
    records: SegmentRecord[];
  }[] = [];
  let word = recording.wordBefore ?? 'online';
  const open = new Map<string, string>();
  let key: Uint8Array | null = null;
  let isOpen = false;
  let framed = false;
  const enter = (atMs: number): (typeof segments)[number] => {
    const last = segments.at(-1);
    if (isOpen && last !== undefined && atMs - last.fromMs < 6000) return last;
    isOpen = true;
    framed = false;
    const made = {
      fromMs: Math.floor(atMs),
      toMs: Math.floor(atMs),
      word,
      faults: [...open.values()],
      records: [],
    };
    segments.push(made);
    return made;
  };
  const put = (segment: (typeof segments)[number], atMs: number, record: object): void => {
    segment.records.push({ ...record, atUs: Math.round(1000 * (atMs - segment.fromMs)) } as SegmentRecord);
    segment.toMs = Math.floor(atMs);
  };
  const all = [
    ...frames.map((frame) => ({ atMs: frame.atMs, frame })),
    ...happened.map((each) => ({ atMs: each.atMs, each })),
  ].sort((a, b) => a.atMs - b.atMs);
  for (const item of all) {
    const atMs = item.atMs + aheadMs;
    if ('frame' in item) {
      const { frame, seq } = item.frame;
      const { isKey } = parseHeader(frame);
      if (hears(item.frame)) {
        if (isKey && isOpen && atMs - segments.at(-1)!.fromMs >= 1000) isOpen = false;
        const segment = enter(atMs);
        if (!framed && !isKey && key !== null) put(segment, atMs, { kind: 'copy', frame: key });
        framed = true;
        put(segment, atMs, { kind: 'frame', lateUs: 5000, seq, frame });
      } else if (isKey) isOpen = false; // the recorder requests the KEY: the next segment begins with a copy
      if (isKey) key = frame;
    } else {
      const { event, word: changed } = item.each;
      const segment = enter(atMs);
      if (event !== undefined) {
        const text = JSON.stringify(event);
        put(segment, atMs, { kind: 'event', text });
        if (event.state === 'on') open.set(event.text, text);
        else open.delete(event.text);
      }
      if (changed !== undefined) {
        put(segment, atMs, { kind: 'word', word: changed });
        word = changed;
        if (word !== 'online') isOpen = false;
      }
    }
  }
  return segments.map(({ fromMs, toMs, word, faults, records }, i) => {
    const start = {
      ...{ robot: 'r', view: 'public', take, index: (recording.firstIndex ?? 0) + i, runId, fromMs },
      ...{ schema: schemaSha, model: 'ab'.repeat(32), word, missing: 0, numbering: take, eventN: 0 },
      ...{ info: new Map([['site', 'lab']]), openFaults: faults },
    };
    return decodeSegment(encodeSegment({ start, toMs, records }));
  });
}

export function fault(n: number, atMs: number, text: string, state: 'on' | 'off' = 'on'): EventMessage {
  return { type: 'event', n, t: 1, at: atMs / 1000, level: 'fault', source: 'LKN', text, state };
}

/** As in an index. */
export function refOf(segment: Segment): SegmentRef {
  const { start, toMs, records } = segment;
  const { take, index, runId, fromMs, schema, model, word } = start;
  const words = [{ atMs: fromMs, word }];
  const events: (EventMessage & { atMs: number })[] = [];
  for (const record of records) {
    const atMs = Math.floor(fromMs + record.atUs / 1000);
    if (record.kind === 'word') words.push({ atMs, word: record.word });
    if (record.kind === 'event') events.push({ ...(JSON.parse(record.text) as EventMessage), atMs });
  }
  const frames = records.filter(({ kind }) => kind === 'frame').length;
  return {
    ...{ take, index, runId, fromMs, toMs, frames, bytes: encodeSegment(segment).length },
    ...{ sha256: `${take}${index}`, schema, model, missing: 0, words, events },
  };
}

export function range(from: number, to: number): number[] {
  return Array.from({ length: to - from }, (_, i) => from + i);
}
