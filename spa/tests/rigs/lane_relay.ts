import {
  Encoder,
  encodeSegment,
  type RobotStatus,
  type Segment,
  type SegmentRecord,
  type SegmentStart,
} from '@posecast/wire';
import type { LaneAnswer } from '../../src/stream/lane/answers.ts';
import { codesWith, SCHEMA, SCHEMA_TEXT } from './schema.ts';

/** A robot, the relay that records it like `past/recorder.py`, and the relay's answers. Times are ms since the start. */

export interface Span {
  readonly fromMs: number;
  readonly toMs: number;
}

export interface LaneStory {
  readonly lastsMs: number;
  readonly keyMs: number;
  /** The robot sends nothing. */
  readonly pauses?: readonly Span[];
  /** Its agent restarts, and counts frames from 1 again. */
  readonly restartsMs?: readonly number[];
  /** Another relay replaces the first: it knows nothing about the time before, and its clock differs by this much. */
  readonly replacedMs?: number;
  readonly otherClockMs?: number;
  /** The approximate interval between events. */
  readonly eventEveryMs?: number;
  /** These events instead, each with the text "jam". */
  readonly faults?: readonly {
    readonly atMs: number;
    readonly source: string;
    readonly state: 'on' | 'off';
  }[];
  /** The other relay does not know earlier faults. */
  readonly otherForgets?: boolean;
  /** Its answers contain their time, to the second. */
  readonly tellsDate?: boolean;
  /** A cache reports the end of the past as it was up to this long ago. */
  readonly endKeptMs?: number;
  /** The interval between KEYs from then on. */
  readonly laterKeyMs?: { readonly atMs: number; readonly keyMs: number };
}

/** A frame as the relay accepted it. */
export interface TrueFrame {
  /** Run and number. */
  readonly name: string;
  /** The moment encoded in its pose, whatever the number. */
  readonly count: number;
  readonly runId: string;
  readonly seq: number;
  readonly tS: number;
  readonly atMs: number;
  readonly bytes: Uint8Array;
  readonly isKey: boolean;
}

interface KeptPart {
  readonly take: string;
  readonly index: number;
  readonly closedMs: number;
  readonly relay: number;
  readonly bytes: Uint8Array;
  readonly segment: Segment;
}

export const UNIX_MS = 1_795_357_260_000;
const SILENT_MS = 1500;
const OFFLINE_MS = 8000;
const FRAME_MS = 1000 / 30;
const HOLD_MS = 8000;
const SCHEMA_HASH = '5c'.repeat(32);
export const LANE_SCHEMA = SCHEMA;

export class LaneRelay {
  readonly frames: TrueFrame[] = [];
  /** The changes of the robot's status, and their times. */
  readonly words: { readonly atMs: number; readonly word: RobotStatus }[] = [];
  readonly events: { readonly atMs: number; readonly n: number; readonly text: string }[] = [];
  readonly parts: KeptPart[] = [];
  readonly #story: LaneStory;

  constructor(story: LaneStory) {
    this.#story = story;
    this.#live();
    this.#record(0, 0, story.replacedMs ?? Number.POSITIVE_INFINITY);
    if (story.replacedMs !== undefined) this.#record(1, story.replacedMs - 3000, Number.POSITIVE_INFINITY);
    this.parts.sort((a, b) => a.closedMs - b.closedMs);
  }

  /** The state word at a moment. */
  wordAt(atMs: number): RobotStatus {
    return this.words.findLast((word) => word.atMs <= atMs)?.word ?? 'offline';
  }

  /** The answer to a request that arrives at `atMs`, and its time; null: it is held until then and then dropped. */
  answer(path: string, atMs: number): { readonly atMs: number; readonly answer: LaneAnswer } {
    const { tellsDate, endKeptMs = 1, replacedMs } = this.#story;
    const say = (status: number, bytes: Uint8Array = new Uint8Array(), at = atMs, isJson = false) => {
      const dateMs = tellsDate ? 1000 * Math.floor((UNIX_MS + at) / 1000) : null;
      const retryMs = status === 200 ? null : 1000;
      return { atMs: at, answer: { status, isJson, retryMs, dateMs, bytes } };
    };
    const json = (value: unknown, at = atMs) => say(200, textBytes(JSON.stringify(value)), at, true);
    const relay = this.#relayAt(atMs);
    if (!path.startsWith('/')) {
      const newest = this.#keptAt(endKeptMs * Math.floor(atMs / endKeptMs)).at(-1);
      const named = newest === undefined ? null : { take: newest.take, index: newest.index };
      return json({ view: 'public', past_ms: 1_800_000, delay_ms: 0, newest: named });
    }
    if (path.startsWith('/public/schema/')) return say(200, textBytes(SCHEMA_TEXT), atMs, true);
    const [, , take = '', index = ''] = path.split('/');
    if (/^\d{4}-/.test(take)) return json(this.#indexAt(Date.parse(take), atMs));
    const isHere = (at: number) =>
      this.#keptAt(at).find((part) => part.take === take && part.index === Number(index));
    const ofTake = this.parts.filter((part) => part.take === take && part.relay === relay);
    if (!ofTake.some((part) => part.closedMs <= atMs)) return say(404);
    const closesMs = this.parts
      .map((part) => part.closedMs)
      .filter((ms) => ms > atMs && ms <= atMs + HOLD_MS);
    for (const ms of [atMs, ...closesMs]) {
      if (this.#relayAt(ms) !== relay) return say(503, undefined, replacedMs);
      const part = isHere(ms);
      if (part !== undefined) return say(200, part.bytes, ms);
      const lastMs = Math.max(...ofTake.map((each) => (each.closedMs <= ms ? each.closedMs : 0)));
      const after = this.#keptAt(ms).find((each) => each.take !== take && each.closedMs > lastMs);
      if (after !== undefined && !ofTake.some((each) => each.index >= Number(index)))
        return json({ next: { take: after.take, index: after.index } }, ms);
    }
    return say(204, undefined, atMs + HOLD_MS);
  }

  /** The index of ten minutes. */
  #indexAt(pageMs: number, atMs: number): unknown {
    const segments = this.#keptAt(atMs).map(({ take, index, segment: { start, records } }) => ({
      ...{ take, index, from_ms: start.fromMs },
      events: records.flatMap((record) =>
        record.kind === 'event'
          ? [{ ...JSON.parse(record.text), at_ms: start.fromMs + record.atUs / 1000 }]
          : [],
      ),
    }));
    const isIn = ({ from_ms }: { from_ms: number }) => from_ms >= pageMs && from_ms < pageMs + 600_000;
    return { view: 'public', from: '', more: false, segments: segments.filter(isIn) };
  }

  #relayAt(atMs: number): number {
    return atMs >= (this.#story.replacedMs ?? Number.POSITIVE_INFINITY) ? 1 : 0;
  }

  #keptAt(atMs: number): KeptPart[] {
    const relay = this.#relayAt(atMs);
    return this.parts.filter((part) => part.relay === relay && part.closedMs <= atMs);
  }

  /** The events, whoever records them. */
  #live(): void {
    const {
      lastsMs,
      keyMs,
      laterKeyMs,
      pauses = [],
      restartsMs = [],
      faults = [],
      eventEveryMs,
    } = this.#story;
    let encoder = new Encoder(SCHEMA, keyMs / 1000);
    let [run, seq, n, keyOf] = [1, 1, 0, keyMs];
    let word: RobotStatus = 'offline';
    let newestMs = Number.NEGATIVE_INFINITY;
    const say = (atMs: number, to: RobotStatus) => {
      if (to !== word) this.words.push({ atMs, word: to });
      word = to;
    };
    const happen = (n: number, atMs: number, source: string, state: string) => {
      const event = { type: 'event', n, t: atMs / 1000, at: (UNIX_MS + atMs) / 1000, level: 'fault' };
      this.events.push({ atMs, n, text: JSON.stringify({ ...event, source, text: 'jam', state }) });
    };
    for (let count = 0; count * FRAME_MS < lastsMs; count++) {
      const atMs = count * FRAME_MS;
      for (; (faults[n]?.atMs ?? Number.POSITIVE_INFINITY) <= atMs; ) {
        const { source, state } = faults[n]!;
        happen(++n, atMs, source, state);
      }
      if (eventEveryMs !== undefined && Math.floor(atMs / eventEveryMs) >= n + 1) {
        n++;
        happen(n, atMs, 'RKN', n % 2 ? 'on' : 'off');
      }
      const restarts = restartsMs.filter((ms) => ms <= atMs).length + 1;
      if (
        restarts !== run ||
        (laterKeyMs !== undefined && atMs >= laterKeyMs.atMs && keyOf !== laterKeyMs.keyMs)
      ) {
        if (restarts !== run) seq = 1;
        run = restarts;
        if (laterKeyMs !== undefined && atMs >= laterKeyMs.atMs) keyOf = laterKeyMs.keyMs;
        encoder = new Encoder(SCHEMA, keyOf / 1000);
      }
      if (pauses.some(({ fromMs, toMs }) => atMs >= fromMs && atMs < toMs)) {
        if (atMs - newestMs > OFFLINE_MS) say(atMs, 'offline');
        else if (atMs - newestMs > SILENT_MS) say(atMs, 'silent');
        continue;
      }
      const codes = codesWith({ 'pos.LKN': Math.round(500 * Math.sin(atMs / 300)), 'pos.NK1': count });
      const tS = seq / 30;
      const isKey = encoder.key;
      const bytes = encoder.encode(codes, seq, tS, atMs / 1000);
      const name = `${run}:${seq}`;
      const runId = `${run}`.padStart(16, '0');
      this.frames.push({
        name,
        count,
        runId,
        seq,
        tS,
        atMs,
        bytes,
        isKey: encoder.key !== isKey,
      });
      newestMs = atMs;
      say(atMs, 'online');
      seq++;
    }
  }

  #record(relay: number, fromMs: number, untilMs: number): void {
    const clockMs = UNIX_MS + (relay === 0 ? 0 : (this.#story.otherClockMs ?? 0));
    const happened = [
      ...this.events.map((event) => ({ atMs: event.atMs, order: 0, event })),
      ...this.frames.map((frame) => ({ atMs: frame.atMs, order: 1, frame })),
      ...this.words.map(({ atMs, word }) => ({ atMs, order: 2, word })),
    ].sort((a, b) => a.atMs - b.atMs || a.order - b.order);
    let [takes, index, runId, eventN] = [0, 0, '', 0];
    let take = '';
    const openFaults = new Map<string, string>();
    const note = (text: string) => {
      const { source, state } = JSON.parse(text) as { source: string; state: string };
      openFaults.delete(source);
      if (state === 'on') openFaults.set(source, text);
    };
    let word: RobotStatus = 'offline';
    let key: TrueFrame | null = null;
    let open: {
      readonly start: SegmentStart;
      readonly beganMs: number;
      readonly records: SegmentRecord[];
    } | null = null;
    const close = (atMs: number) => {
      if (open === null) return;
      const segment = { start: open.start, toMs: Math.floor(clockMs + atMs), records: open.records };
      this.parts.push({ take, index, closedMs: atMs, relay, bytes: encodeSegment(segment), segment });
      open = null;
      index++;
    };
    const newTake = () => {
      take = `${relay}${takes++}`.padEnd(16, 'a');
      index = 0;
    };
    const enter = (atMs: number) => {
      open ??= {
        start: {
          ...{ robot: 'small', view: 'public', take, index, runId: runId || '0'.repeat(16) },
          ...{
            fromMs: Math.floor(clockMs + atMs),
            schema: SCHEMA_HASH,
            model: 'ab'.repeat(32),
            word,
            missing: 0,
          },
          ...{
            numbering: 'x',
            eventN,
            info: new Map([['mode', 'walking']]),
            openFaults: [...openFaults.values()],
          },
        },
        beganMs: atMs,
        records: [],
      };
      return open;
    };
    const atUsOf = (atMs: number, start: SegmentStart) => Math.floor((clockMs + atMs - start.fromMs) * 1000);
    newTake();
    for (const each of happened) {
      const { atMs } = each;
      if (atMs >= untilMs) break;
      const frame = 'frame' in each ? each.frame : null;
      if (frame?.isKey) key = frame;
      if (atMs < fromMs) {
        if ('word' in each) word = each.word;
        if ('event' in each && !this.#story.otherForgets) {
          eventN = each.event.n;
          note(each.event.text);
        }
        if (frame !== null) runId = frame.runId;
        continue;
      }
      if (open !== null && atMs - (open as { beganMs: number }).beganMs >= 6000)
        close((open as { beganMs: number }).beganMs + 6000);
      if (frame !== null && frame.runId !== runId) {
        close(atMs);
        newTake();
        runId = frame.runId;
      }
      if (frame?.isKey && open !== null && atMs - (open as { beganMs: number }).beganMs >= 1000) close(atMs);
      const { start, records } = enter(atMs);
      const atUs = atUsOf(atMs, start);
      if (frame !== null) {
        if (!frame.isKey && !records.some(({ kind }) => kind === 'frame') && key !== null)
          records.push({ kind: 'copy', atUs, frame: key.bytes });
        records.push({
          kind: 'frame',
          atUs,
          lateUs: 0,
          seq: frame.seq,
          frame: frame.bytes,
        });
      } else if ('event' in each) {
        records.push({ kind: 'event', atUs, text: each.event.text });
        eventN = each.event.n;
        note(each.event.text);
      } else if ('word' in each) {
        records.push({ kind: 'word', atUs, word: each.word });
        word = each.word;
        if (each.word !== 'online') close(atMs);
      }
    }
    close(Math.min(untilMs, this.#story.lastsMs));
  }
}

function textBytes(text: string): Uint8Array {
  return new TextEncoder().encode(text);
}
