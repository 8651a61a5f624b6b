import type { EventMessage, Schema } from '@posecast/wire';
import { Emitter, isWithin, type Span } from '../kit.ts';
import { JointTable } from './joints.ts';
import type { KinematicTree } from './kinematic_tree.ts';
import { NO_EDITS, type ThresholdEdits, ValueLimits } from './limits.ts';
import { type Evidence, HoldUps, newestAgeMs, STALE_AFTER_MS, type Status } from './liveness.ts';
import { isolated } from './names.ts';
import { valueAt } from './values.ts';

/** Maximum number of events kept, as many as the relay keeps; the oldest are dropped. */
export const EVENT_LIMIT = 100;

/** One decoded frame with the stream's data about its freshness (times in ms of the viewer's clock). */
export interface RobotState {
  schemaId: number;
  seq: number;
  /** Robot time, seconds. */
  tS: number;
  codes: Int32Array;
  /** When the last frame newer than the relay's status was written, at the earliest; see `Evidence`. */
  freshMs: number | null;
  /** When this was the robot's newest frame, at the earliest; null: it may be of any age. */
  bornMs: number | null;
  /** When the pose last changed. */
  changedMs: number;
  /** When it arrived. */
  atMs: number;
  /** Its delay in transit, at least, ms. */
  lateMs?: number;
  /** Its delay in transit, at most, ms. `freshMs` and `bornMs` assume that. */
  transitMs?: number;
}

/** A state that led up to another. */
export type LeadState = Pick<RobotState, 'tS' | 'codes' | 'atMs'>;

/**
 * Everything that the page knows about one robot, kept outside React. It has two kinds of listeners: `onState` for each new frame
 * (at frame rate), `onChange` for rare changes (schema, info, events, model, connection).
 */
export class RobotTwin {
  readonly robot: string;
  schema: Schema | null = null;
  state: RobotState | null = null;
  /** The states that led up to `state`, oldest first, if the past is at rest; null otherwise. */
  lead: readonly LeadState[] | null = null;
  info: ReadonlyMap<string, string> = new Map();
  /** Newest last. */
  events: readonly EventMessage[] = [];
  /** Whether these are all recent events; otherwise older ones are still to come. */
  hasAllEvents = true;
  /** The deleted spans of its past, unix ms by the relay's clock. */
  deleted: readonly Span[] = [];
  modelHash: string | null = null;
  /** The kinematic tree of the model; null while no model is loaded. */
  tree: KinematicTree | null = null;
  /** The limits in effect: the viewer's own, else the profile's; null until there is a schema. */
  limits: ValueLimits | null = null;
  edits: ThresholdEdits = NO_EDITS;
  readonly evidence: Evidence;
  /** Counts changes, so that a listener can cheaply check whether it is up to date. */
  version = 0;

  #joints: JointTable | null = null;
  /** The state and the limits for which `#joints` was last read. */
  #readFrom: readonly unknown[] = [];
  #watching = true;
  /** Moved to another relay that has reported nothing about the robot yet. */
  #moved = false;
  readonly #frames = new Emitter();
  readonly #changes = new Emitter();

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
      transitMs: 0,
      holdUps: new HoldUps(),
    };
  }

  /** The robot's name as the page shows it. */
  get name(): string {
    return this.schema === null ? this.robot : isolated(this.schema.robot);
  }

  readonly onState = this.#frames.on;

  readonly onChange = this.#changes.on;

  /** A new schema makes the old codes meaningless: they are dropped, and nothing is shown until a frame of it arrives. */
  acceptSchema(schema: Schema): void {
    if (this.schema?.id === schema.id) return;
    this.schema = schema;
    this.limits = new ValueLimits(schema.mapping, this.edits);
    this.state = this.lead = null;
    this.#joints = null;
    this.#changed();
  }

  /** The joint table of the newest frame, read once for all callers; null before there is a schema. */
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
    if (this.schema?.id !== state.schemaId) return; // overtaken by a new schema in transit
    this.state = state;
    this.lead = null;
    if (state.freshMs !== null) this.evidence.freshMs = state.freshMs;
    this.evidence.transitMs = state.transitMs ?? 0;
    if (this.#watching) this.evidence.changedMs = state.changedMs; // otherwise no later frame would report the change
    this.#shows(state.bornMs);
    this.heard(state.atMs - (state.lateMs ?? 0)); // a delayed frame proves nothing about the time since
    this.#frames.emit();
  }

  /** Takes the states that led up to the newest one, oldest first, with its schema. State listeners are called again with that
   *  state, because values that depend on history can now be computed as if it had been played. */
  acceptLead(lead: readonly LeadState[]): void {
    if (this.state === null) return;
    this.lead = lead;
    this.#frames.emit();
  }

  /** Takes the relay's status. A relay to which the page has just moved may not know the robot yet: its status is ignored until
   *  the previous relay's status is old. */
  acceptStatus(status: Status): void {
    const oldMs = newestAgeMs(this.evidence, status.atMs);
    const isNoNews = status.degraded || status.robot === 'offline' || status.seq === null;
    if (this.#moved && isNoNews && oldMs !== null && oldMs < STALE_AFTER_MS) return;
    this.#moved = false;
    const { evidence } = this;
    evidence.status = status;
    evidence.transitMs = status.transitMs ?? 0;
    this.heard(status.heardMs ?? status.atMs);
    const { seq, ageMs, atMs } = status;
    // What arrived before it was written before it, even if it seemed less delayed: frames may not say when they were written.
    if (evidence.freshMs !== null) evidence.freshMs = Math.min(evidence.freshMs, atMs);
    if (evidence.shownMs !== null) evidence.shownMs = Math.min(evidence.shownMs, atMs);
    if (seq !== null && seq === this.state?.seq && ageMs !== null) this.#shows(atMs - ageMs);
  }

  /** Records when the shown pose was new. A frame of unknown age (null) does not make it younger. */
  #shows(bornMs: number | null): void {
    if (bornMs !== null) this.evidence.shownMs = Math.max(bornMs, this.evidence.shownMs ?? bornMs);
  }

  heard(nowMs: number): void {
    this.evidence.heardMs = Math.max(nowMs, this.evidence.heardMs ?? 0); // states may be delivered late
  }

  /** The connection is now to another relay, and the previous relay's data is not old yet. */
  acceptMove(): void {
    this.#moved = true;
  }

  /** `goesOn`: the old connection was given up for another, which is tried at once, as when a full relay names its lane. A page
   *  that has shown no pose yet then counts as still opening. */
  acceptConnection(connected: boolean, nowMs: number, goesOn = false): void {
    if (this.evidence.connected === connected) return;
    this.#moved = false;
    this.evidence.connected = connected;
    if (connected) {
      // Facts from the old connection may not hold for the new one.
      this.evidence.lostMs = null;
      this.evidence.status = null;
      this.evidence.freshMs = null;
      this.evidence.otherwiseMs = null;
      this.#forgetPicture(nowMs);
    } else {
      this.evidence[goesOn && this.state === null ? 'openedMs' : 'lostMs'] = nowMs;
    }
    this.#changed();
  }

  /** The stream was delayed and is without delay from now on: earlier freshness says nothing about now. */
  acceptCatchUp(): void {
    this.evidence.freshMs = this.evidence.otherwiseMs = null;
  }

  /** Records that a thread of the page did not run for a while. That of a hidden page need not. */
  acceptHoldUp(fromMs: number, toMs: number): void {
    if (this.#watching) this.evidence.holdUps.record(fromMs, toMs);
  }

  /** Records whether poses are requested; a hidden page requests none. */
  acceptWatching(watching: boolean, nowMs: number): void {
    this.#watching = watching;
    this.#forgetPicture(nowMs);
    this.#changed();
  }

  /** The pose on the screen may be old from now on, and the time since its last change is unknown. */
  #forgetPicture(nowMs: number): void {
    this.evidence.watchingMs = this.#watching ? nowMs : null;
    this.evidence.shownMs = null;
    this.evidence.changedMs = null;
  }

  /** Adds an event. The relay repeats its last hundred at every join, so known ones are dropped. */
  acceptEvent(event: EventMessage): void {
    if (this.#isDeleted(event)) return;
    if (this.events.some((known) => known.n === event.n && known.at === event.at)) return;
    const newest = this.events.at(-1);
    // A number that goes back means that the relay has restarted its count: the earlier events no longer belong to its list.
    const kept = newest !== undefined && event.n < newest.n ? [] : this.events;
    this.events = [...kept, event].slice(-EVENT_LIMIT);
    this.#changed();
  }

  /** Adds earlier events among the known ones of the same count. `isAll`: see `hasAllEvents`. */
  acceptEarlier(earlier: readonly EventMessage[], isAll: boolean): void {
    // end events made up for missed ones (`stream/lane/part_player.ts`) are replaced by the real ones
    const known = this.events.filter(({ n }) => earlier.length === 0 || Number.isInteger(n));
    const kept = earlier.filter((event) => !this.#isDeleted(event));
    const byN = new Map([...kept, ...known].map((event) => [event.n, event]));
    this.events = [...byN.values()].sort((a, b) => a.n - b.n).slice(-EVENT_LIMIT);
    this.hasAllEvents = isAll;
    this.#changed();
  }

  /** Forgets the events of deleted spans (unix ms), also if the relay repeats them. */
  acceptDeleted(spans: readonly Span[]): void {
    this.deleted = spans;
    this.events = this.events.filter((event) => !this.#isDeleted(event));
    this.#changed();
  }

  #isDeleted({ at }: EventMessage): boolean {
    return at !== null && isWithin(1000 * at, this.deleted);
  }

  /** Sets the viewer's own thresholds. They are kept when the schema changes. */
  acceptEdits(edits: ThresholdEdits): void {
    this.edits = edits;
    if (this.schema !== null) this.limits = new ValueLimits(this.schema.mapping, edits);
    this.#changed();
  }

  /** Forgets the events: what follows is from another time. */
  forgetEvents(): void {
    this.events = [];
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

  /** One value of the newest frame in the schema's unit; null: no reading; undefined: no such channel. */
  value(fieldName: string, label: string): number | null | undefined {
    const field = this.schema?.field(fieldName) ?? null;
    const index = field?.labels.indexOf(label) ?? -1;
    if (field === null || index < 0) return undefined;
    return this.state === null ? null : valueAt(this.state.codes, field, index);
  }

  #changed(): void {
    this.version += 1;
    this.#changes.emit();
  }
}
