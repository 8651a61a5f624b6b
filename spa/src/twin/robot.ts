import type { EventMessage, Schema } from '@posecast/wire';
import { JointTable } from './joints.ts';
import type { KinematicTree } from './kinematic_tree.ts';
import { NO_EDITS, type ThresholdEdits, ValueLimits } from './limits/limits.ts';
import type { Evidence, Status } from './liveness.ts';
import { isolated } from './names.ts';
import { valueAt } from './values.ts';

/** As many as the relay keeps; the oldest go first. */
export const EVENT_LIMIT = 100;

/** The newest decoded state, with what the stream knows of its freshness (ms, the viewer's clock). */
export interface RobotState {
  schemaId: number;
  seq: number;
  /** Robot time, seconds. */
  tS: number;
  codes: Int32Array;
  freshMs: number | null;
  /** When this was the newest that the robot had; null: it may be of any age. */
  bornMs: number | null;
  changedMs: number;
  /** When it arrived. */
  atMs: number;
  /** How long it had waited on its way, as far as that is known. */
  lateMs?: number;
}

/**
 * All the page knows of one robot, outside React. Two kinds of listener: `onState` for what moves (at frame rate),
 * `onChange` for what seldom changes (schema, info, events, model, link).
 */
export class RobotTwin {
  readonly robot: string;
  schema: Schema | null = null;
  state: RobotState | null = null;
  info: ReadonlyMap<string, string> = new Map();
  /** Newest last. */
  events: readonly EventMessage[] = [];
  modelHash: string | null = null;
  /** How the links of the model hang together; null while there is none on the page. */
  tree: KinematicTree | null = null;
  /** Which limits hold: the profile's, and what the viewer has set instead; null until there is a schema. */
  limits: ValueLimits | null = null;
  edits: ThresholdEdits = NO_EDITS;
  readonly evidence: Evidence;
  /** Counts changes, so that a listener can tell cheaply whether it is up to date. */
  version = 0;

  #joints: JointTable | null = null;
  /** Which frame, by which limits, they were read from. */
  #readFrom: readonly unknown[] = [];
  #watching = true;
  readonly #stateListeners = new Set<() => void>();
  readonly #changeListeners = new Set<() => void>();

  constructor(robot: string, nowMs: number) {
    this.robot = robot;
    this.evidence = {
      openedMs: nowMs,
      connected: false,
      lostMs: null,
      heardMs: null,
      status: null,
      freshMs: null,
      changedMs: null,
      watchingMs: null,
      shownMs: null,
      otherwiseMs: null,
    };
  }

  /** What it is called on the page. */
  get name(): string {
    return this.schema === null ? this.robot : isolated(this.schema.robot);
  }

  onState(listener: () => void): () => void {
    this.#stateListeners.add(listener);
    return () => this.#stateListeners.delete(listener);
  }

  onChange(listener: () => void): () => void {
    this.#changeListeners.add(listener);
    return () => this.#changeListeners.delete(listener);
  }

  /** A new schema makes the old codes meaningless: they go, and nothing is shown until a frame of the new one comes. */
  acceptSchema(schema: Schema): void {
    if (this.schema?.id === schema.id) return;
    this.schema = schema;
    this.limits = new ValueLimits(schema.mapping, this.edits);
    this.state = null;
    this.#joints = null;
    this.#changed();
  }

  /** The joints of the newest frame, read once however many ask; null before there is a schema. */
  joints(): JointTable | null {
    const { schema, state, limits } = this;
    if (schema === null || limits === null) return null;
    this.#joints ??= new JointTable(schema);
    if (state !== null && (state !== this.#readFrom[0] || limits !== this.#readFrom[1])) {
      this.#readFrom = [state, limits];
      this.#joints.read(state.codes, limits);
    }
    return this.#joints;
  }

  acceptState(state: RobotState): void {
    if (this.schema?.id !== state.schemaId) return; // overtaken by a new schema on its way here
    this.state = state;
    if (state.freshMs !== null) this.evidence.freshMs = state.freshMs;
    this.evidence.changedMs = state.changedMs;
    this.#shows(state.bornMs);
    this.heard(state.atMs - (state.lateMs ?? 0)); // what has lain on its way tells of then
    for (const listener of this.#stateListeners) listener();
  }

  acceptStatus(status: Status): void {
    this.evidence.status = status;
    this.heard(status.atMs);
    const { seq, ageMs } = status;
    if (seq !== null && seq === this.state?.seq && ageMs !== null) this.#shows(status.atMs - ageMs);
  }

  /** What the picture shows was new then. A frame that nobody vouches for makes it no younger. */
  #shows(bornMs: number | null): void {
    if (bornMs !== null) this.evidence.shownMs = Math.max(bornMs, this.evidence.shownMs ?? bornMs);
  }

  heard(nowMs: number): void {
    this.evidence.heardMs = Math.max(nowMs, this.evidence.heardMs ?? 0); // a state may have waited its turn
  }

  acceptConnection(connected: boolean, nowMs: number): void {
    if (this.evidence.connected === connected) return;
    this.evidence.connected = connected;
    if (connected) {
      // What an old connection knew of the robot is not what this one knows.
      this.evidence.lostMs = null;
      this.evidence.status = null;
      this.evidence.freshMs = null;
      this.evidence.otherwiseMs = null;
      this.#forgetPicture(nowMs);
    } else {
      this.evidence.lostMs = nowMs;
    }
    this.#changed();
  }

  /** Whether poses are asked for: a hidden page wants none. */
  acceptWatching(watching: boolean, nowMs: number): void {
    this.#watching = watching;
    this.#forgetPicture(nowMs);
    this.#changed();
  }

  /** What is on the screen may be old, and how long it has stood still is not known. */
  #forgetPicture(nowMs: number): void {
    this.evidence.watchingMs = this.#watching ? nowMs : null;
    this.evidence.shownMs = null;
    this.evidence.changedMs = null;
  }

  /** The relay gives its last hundred at every join, so numbers already here are dropped. */
  acceptEvent(event: EventMessage): void {
    if (this.events.some((known) => known.n === event.n && known.at === event.at)) return;
    const newest = this.events.at(-1);
    // A number that falls back means that the relay counts anew: what it says from here on is all there is.
    const kept = newest !== undefined && event.n < newest.n ? [] : this.events;
    this.events = [...kept, event].slice(-EVENT_LIMIT);
    this.#changed();
  }

  /** The viewer's own thresholds. They hold for whatever schema comes. */
  acceptEdits(edits: ThresholdEdits): void {
    this.edits = edits;
    if (this.schema !== null) this.limits = new ValueLimits(this.schema.mapping, edits);
    this.#changed();
  }

  acceptInfo(info: ReadonlyMap<string, string>): void {
    this.info = info;
    this.#changed();
  }

  acceptModel(hash: string | null): void {
    if (this.modelHash === hash) return;
    this.modelHash = hash;
    this.#changed();
  }

  acceptTree(tree: KinematicTree | null): void {
    if (this.tree === tree) return;
    this.tree = tree;
    this.#changed();
  }

  /** One value in the schema's unit; null is no reading, undefined no such channel. */
  value(fieldName: string, label: string): number | null | undefined {
    const field = this.schema?.field(fieldName) ?? null;
    const index = field?.labels.indexOf(label) ?? -1;
    if (field === null || index < 0) return undefined;
    return this.state === null ? null : valueAt(this.state.codes, field, index);
  }

  #changed(): void {
    this.version += 1;
    for (const listener of this.#changeListeners) listener();
  }
}
