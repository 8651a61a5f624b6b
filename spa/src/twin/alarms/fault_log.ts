import type { EventMessage, Schema } from '@posecast/wire';
import { dropOldest, isWithin, type Span } from '../../kit.ts';
import { flagWords } from '../format.ts';
import type { JointRow, LimitedName } from '../joints.ts';
import type { ValueLimits } from '../limits.ts';
import { causeOf } from '../names.ts';
import { Occurrences } from './occurrences.ts';

/** The kind of fault: a flag bit set by the robot, an exceeded limit (current, temperature), or a joint that has long deviated
 *  from its command (`apart`). */
type What = 'flag' | 'apart' | LimitedName;

/** One fault, kept until it is over and acknowledged. A caution disappears on its own when it is over. */
export interface Fault {
  readonly key: string;
  readonly level: 'fault' | 'caution';
  readonly what: What;
  /** Joint or sensor, as the robot names it. */
  readonly source: string;
  /** "jam": for a flag; empty otherwise. */
  readonly words: string;
  /** Unix ms of its first start since it was last acknowledged; by the relay's clock if an event reported it. */
  firstMs: number;
  /** When it was over; null while it lasts. */
  clearedMs: number | null;
  acknowledged: boolean;
}

/** Acknowledged faults: key → unix ms of the newest acknowledged start. */
export type Acknowledged = ReadonlyMap<string, number>;

/** Maximum number of faults kept. Beyond that, the oldest one that is over is dropped, or the oldest of all if none is over. */
export const FAULT_LIMIT = 500;
const ACK_LIMIT = 200;
/** A joint that deviates from its command for less time is only lagging, which is normal. */
export const STALLED_AFTER_MS = 2000;
/** After a longer pause between frames, the joints' positions meanwhile are unknown, so stall times restart. */
const PAUSE_MS = 5000;

interface Entry extends Fault {
  riseMs: number;
}

type Named = Pick<Fault, 'key' | 'level' | 'what' | 'source' | 'words'>;

/**
 * Collects faults from both events and frames. Events report short faults that a 1 Hz viewer's frames miss; frames show lasting
 * faults whose event is no longer available. A fault from either source stays until it is acknowledged.
 */
export class FaultLog {
  /** How often each fault occurred recently, including acknowledged occurrences. */
  readonly occurrences = new Occurrences();
  readonly #entries = new Map<string, Entry>();
  #acknowledged = new Map<string, number>();
  /** Keys of the faults in the newest frame; null before the first frame, whose faults may be old. */
  #shown: Set<string> | null = null;
  /** Joints that deviate from their command → since when, ms. */
  readonly #apartMs = new Map<string, number>();
  #lookedMs = Number.NEGATIVE_INFINITY;
  /** Counts changes, so that a reader can check whether it is up to date. */
  version = 0;
  #sorted: { version: number; faults: readonly Fault[]; worst: ReadonlyMap<string, Fault> } | null = null;

  constructor(acknowledged: Acknowledged = new Map()) {
    this.#acknowledged = new Map(acknowledged);
  }

  /** All faults that are unacknowledged or active: faults before cautions, active before past; active ones oldest first, past
   *  ones most recent first. */
  get faults(): readonly Fault[] {
    return this.#inOrder().faults;
  }

  get acknowledged(): Acknowledged {
    return this.#acknowledged;
  }

  /** The first unacknowledged fault of a joint or sensor, active or over; null if it has none. */
  of(source: string): Fault | null {
    return this.#inOrder().worst.get(source) ?? null;
  }

  #inOrder() {
    if (this.#sorted?.version === this.version) return this.#sorted;
    const faults = [...this.#entries.values()].sort(
      (a, b) =>
        Number(a.level === 'caution') - Number(b.level === 'caution') ||
        Number(b.clearedMs === null) - Number(a.clearedMs === null) ||
        (a.clearedMs === null ? a.firstMs - b.firstMs : this.#newestMs(b) - this.#newestMs(a)),
    );
    const worst = new Map<string, Fault>();
    for (const fault of faults) {
      if (fault.level === 'fault' && !fault.acknowledged && !worst.has(fault.source))
        worst.set(fault.source, fault);
    }
    this.#sorted = { version: this.version, faults, worst };
    return this.#sorted;
  }

  #newestMs({ key, firstMs }: Fault): number {
    return this.occurrences.newestMs(key) ?? firstMs;
  }

  event(event: EventMessage, nowMs: number): void {
    if (event.level !== 'fault') return;
    const key = causeOf(event);
    const atMs = event.at === null ? nowMs : event.at * 1000;
    const entry = this.#entries.get(key);
    if (event.state === 'off') {
      // while frames show it, they decide when it ends
      if (entry === undefined || atMs < entry.riseMs || this.#shown?.has(key)) return;
      if (entry.clearedMs !== atMs) this.#clear(entry, atMs);
      return;
    }
    this.occurrences.addEvent(key, atMs, nowMs);
    if (atMs <= (this.#acknowledged.get(key) ?? Number.NEGATIVE_INFINITY)) return; // repeated at a new join
    if (entry !== undefined && atMs <= entry.riseMs) return;
    if (entry !== undefined && !entry.acknowledged) {
      entry.riseMs = atMs; // already known, or the frame arrived before its event
      this.version += 1;
      return;
    }
    const of = {
      key,
      level: 'fault',
      what: 'flag',
      source: event.source,
      words: flagWords(event.text),
    } as const;
    this.#rise(of, atMs, this.#shown?.has(key) ? null : atMs);
  }

  /** Takes the joint rows of a new frame. */
  rows(rows: readonly JointRow[], nowMs: number): void {
    const shown = new Set<string>();
    if (nowMs - this.#lookedMs > PAUSE_MS) this.#apartMs.clear();
    this.#lookedMs = nowMs;
    for (const row of rows) {
      const sinceMs = this.#apartSince(row, nowMs);
      if (row.level === 'fault') {
        for (const [what, text, words] of faultsOf(row)) {
          const key = causeOf({ source: row.label, text });
          shown.add(key);
          this.#lasts({ key, level: 'fault', what, source: row.label, words }, nowMs, nowMs);
        }
      } else if (sinceMs !== null && nowMs - sinceMs >= STALLED_AFTER_MS) {
        const key = causeOf({ source: row.label, text: 'apart' });
        shown.add(key);
        this.#lasts({ key, level: 'caution', what: 'apart', source: row.label, words: '' }, sinceMs, nowMs);
      }
    }
    for (const [key, entry] of this.#entries) {
      if (entry.clearedMs === null && !shown.has(key)) this.#clear(entry, nowMs);
    }
    this.#shown = shown;
  }

  /** Since when (ms) a joint has deviated from its command; null if it does not. A joint without power can't follow and doesn't
   *  count. */
  #apartSince({ label, apart, enabled }: JointRow, nowMs: number): number | null {
    if (!apart || enabled === false) {
      this.#apartMs.delete(label);
      return null;
    }
    const sinceMs = this.#apartMs.get(label) ?? nowMs;
    this.#apartMs.set(label, sinceMs);
    return sinceMs;
  }

  /** Acknowledges faults: those that are over are removed; active ones stay, marked as acknowledged, until they are over. */
  acknowledge(keys: Iterable<string>): void {
    for (const key of keys) {
      const entry = this.#entries.get(key);
      if (entry === undefined) continue;
      entry.acknowledged = true;
      this.#acknowledged.delete(key); // re-inserted below, so that the newest is last
      this.#acknowledged.set(key, entry.riseMs);
      if (entry.clearedMs !== null) this.#entries.delete(key);
    }
    dropOldest(this.#acknowledged, ACK_LIMIT);
    this.version += 1;
  }

  /** Forgets the faults that are over and began in one of these spans, unix ms. */
  forget(spans: readonly Span[]): void {
    for (const [key, { riseMs, clearedMs }] of this.#entries)
      if (clearedMs !== null && isWithin(riseMs, spans)) this.#entries.delete(key);
    this.version += 1;
  }

  #lasts(of: Named, riseMs: number, nowMs: number): void {
    const { key, level } = of;
    const entry = this.#entries.get(key);
    if (this.#shown?.has(key) && entry !== undefined) return;
    this.occurrences.addFrame(key, riseMs, nowMs);
    if (entry !== undefined && !entry.acknowledged) {
      if (entry.clearedMs === null) return;
      entry.clearedMs = null;
      this.version += 1;
      return;
    }
    // A fault in the first frame may have been acknowledged before the page was opened; a caution appears only after a while.
    const known = (this.#shown === null || level === 'caution') && this.#acknowledged.has(key);
    this.#rise(of, known ? (this.#acknowledged.get(key) ?? riseMs) : riseMs, null, known);
  }

  #rise(of: Named, riseMs: number, clearedMs: number | null, acknowledged = false): void {
    this.#entries.set(of.key, { ...of, firstMs: riseMs, riseMs, clearedMs, acknowledged });
    if (this.#entries.size > FAULT_LIMIT) {
      const all = [...this.#entries.values()];
      const oldest = all.find((entry) => entry.clearedMs !== null) ?? all[0];
      if (oldest !== undefined) this.#entries.delete(oldest.key);
    }
    this.version += 1;
  }

  #clear(entry: Entry, atMs: number): void {
    if (entry.level === 'caution') this.#acknowledged.delete(entry.key);
    if (entry.acknowledged || entry.level === 'caution') this.#entries.delete(entry.key);
    else entry.clearedMs = Math.max(atMs, entry.riseMs);
    this.version += 1;
  }
}

/** Whether a fault of this robot could be seen: it has flags, a limit, or a tolerance between reference and position. */
export function canKnowFaults(schema: Schema, limits: ValueLimits): boolean {
  const { fields, mapping } = schema;
  const isJudged = (name: string, label: string) =>
    limits.threshold(name, label) !== null ||
    (name === 'pos' && schema.field('ref') !== null && mapping.tolerance(label) !== null);
  return fields.some(
    ({ name, labels, bits }) =>
      bits.some((bit) => mapping.severity(name, bit) === 'fault') ||
      labels.some((label) => isJudged(name, label)),
  );
}

function* faultsOf(row: JointRow): Generator<[what: What, text: string, words: string]> {
  for (const flag of row.flags) if (flag.severity === 'fault') yield ['flag', flag.name, flag.words];
  for (const name in row.levels)
    if (row.levels[name as LimitedName] === 'fault') yield [name as LimitedName, name, ''];
}

/** Serialises acknowledgements to JSON for the browser's storage. */
export function acknowledgedText(acknowledged: Acknowledged): string {
  return JSON.stringify([...acknowledged]);
}

/** Reads acknowledgements from stored JSON. Never throws: invalid text or entries are left out. */
export function readAcknowledged(text: string | null): Acknowledged {
  let stored: unknown = null;
  try {
    stored = JSON.parse(text ?? 'null');
  } catch {
    // treated like nothing stored
  }
  const found = new Map<string, number>();
  for (const pair of Array.isArray(stored) ? stored.slice(-ACK_LIMIT) : []) {
    if (Array.isArray(pair) && typeof pair[0] === 'string' && Number.isFinite(pair[1])) {
      found.set(pair[0], pair[1] as number);
    }
  }
  return found;
}
