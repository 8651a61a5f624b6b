import { expect } from 'vitest';
import { Lane, type LaneAction } from '../../src/stream/lane/lane.ts';
import { type KnownBefore, ToldFaults } from '../../src/stream/lane_port.ts';
import type { FromStream } from '../../src/stream/messages.ts';
import { judge, type Verdict } from '../../src/twin/liveness.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { LANE_SCHEMA, LaneRelay, type LaneStory, type Span, type TrueFrame } from './lane_relay.ts';
import { seeded } from './playout_sim.ts';

export interface LaneNetwork {
  /** Transit time of a request or an answer. */
  readonly wayMs: () => number;
  /** Requests that arrive then get no answer. */
  readonly cuts?: readonly Span[];
  /** Requests that arrive then are refused with 404. */
  readonly blackouts?: readonly Span[];
  /** Whether the index is available; otherwise the request is cut off. */
  readonly hasIndex?: boolean;
  /** For the index's answers in order: the delay, and the status instead of 200. */
  readonly index?: readonly { readonly lateMs?: number; readonly status?: number }[];
}

export interface Shown {
  readonly name: string;
  /** When it was shown and when the relay had it, ms since the start. */
  readonly atMs: number;
  readonly acceptedMs: number;
}

/** Where the codes encode the frame number. */
const COUNT = LANE_SCHEMA.field('pos')!.start + 2;

/** A page in the lane, with a clock that is wrong by a day. */
export class LaneViewer {
  readonly requests: { readonly atMs: number; readonly path: string }[] = [];
  /** The additional requests, for the index. */
  readonly looks: { readonly atMs: number; readonly path: string }[] = [];
  readonly shown: Shown[] = [];
  events: { readonly atMs: number; readonly n: number }[] = [];
  readonly behinds: { readonly atMs: number; readonly ms: number | null }[] = [];
  readonly words: { readonly atMs: number; readonly verdict: Verdict }[] = [];
  readonly posts: FromStream[] = [];
  readonly ends: { readonly code: number; readonly reason: string }[] = [];
  readonly twin: RobotTwin;
  /** When the first part had arrived. */
  openMs = Number.NaN;
  nowMs: number;
  #lane: Lane;
  readonly #random: () => number;
  readonly #relay: LaneRelay;
  readonly #frames: ReadonlyMap<number, TrueFrame>;
  readonly #network: LaneNetwork;
  readonly #skewMs = 86_400_000 * 3 - 12_345;
  #answer: { readonly atMs: number; readonly tell: () => LaneAction[] } | null = null;
  #look: { readonly atMs: number; readonly tell: () => LaneAction[] } | null = null;

  constructor(
    relay: LaneRelay,
    network: LaneNetwork,
    joinsMs: number,
    random: () => number,
    before: KnownBefore = { frame: null, event: null, faults: [] },
  ) {
    this.#relay = relay;
    this.#frames = new Map(relay.frames.map((frame) => [frame.count, frame]));
    this.#network = network;
    this.nowMs = joinsMs;
    this.#random = random;
    this.#lane = this.#begin(before);
    this.twin = new RobotTwin('small', this.#clock(joinsMs));
    this.#do(this.#lane.start(this.#clock(joinsMs)));
  }

  /** Advances the time. A frozen page does nothing meanwhile, and answers wait. */
  run(untilMs: number, isFrozen = false): void {
    if (isFrozen) this.nowMs = untilMs;
    while (this.nowMs < untilMs && this.ends.length === 0) {
      const dueMs = Math.min(this.nowMs + 250, this.#lane.nextMs - this.#skewMs);
      const nextMs = Math.min(
        untilMs,
        Math.max(this.nowMs + 1, Math.min(dueMs, this.#answer?.atMs ?? dueMs, this.#look?.atMs ?? dueMs)),
      );
      this.nowMs = nextMs;
      const look = this.#look;
      if (look !== null && look.atMs <= nextMs) {
        this.#look = null;
        this.#do(look.tell());
      }
      const answer = this.#answer;
      if (answer !== null && answer.atMs <= nextMs) {
        this.#answer = null;
        this.#do(answer.tell());
      } else this.#do(this.#lane.tick(this.#clock(nextMs)));
      const verdict = judge(this.twin.evidence, this.#clock(nextMs));
      this.words.push({ atMs: nextMs, verdict });
    }
  }

  /** After its end: the page opens the lane again, which is told what was shown before. */
  reopen(joinsMs: number): void {
    this.run(joinsMs, true);
    this.ends.length = 0;
    const { state, events } = this.twin;
    const frame = state && { ...state, atMs: state.atMs - this.#skewMs - this.behindAt(this.nowMs) };
    const faults = new ToldFaults();
    for (const event of events) faults.record(event);
    this.#lane = this.#begin({ frame, event: events.at(-1) ?? null, faults: faults.open });
    this.#do(this.#lane.start(this.#clock(this.nowMs)));
  }

  #begin(before: KnownBefore): Lane {
    const frame = before.frame && { ...before.frame, atMs: this.#clock(before.frame.atMs) };
    const settings = { robot: 'small', view: null, hz: 30, isVisible: true, random: this.#random };
    return new Lane({ ...settings, before: { ...before, frame } });
  }

  /** The sources of open faults, from what it reported. */
  get openFaults(): string[] {
    const states = new Map(this.twin.events.map(({ source, state }) => [source, state]));
    return [...states].flatMap(([source, state]) => (state === 'on' ? [source] : []));
  }

  /** The delay that it reported. */
  behindAt(atMs: number): number {
    return this.behinds.findLast((told) => told.atMs <= atMs)?.ms ?? Number.NaN;
  }

  shownAfter(atMs: number): Shown[] {
    return this.shown.filter((each) => each.atMs > atMs);
  }

  /** The delay that this part of the frames had at most, of those shown after a moment. */
  delay(part: number, afterMs = 0): number {
    const delays = this.shownAfter(afterMs).map(({ atMs, acceptedMs }) => atMs - acceptedMs);
    return quantile(delays, part);
  }

  setVisible(isVisible: boolean): void {
    this.twin.acceptWatching(isVisible, this.#clock(this.nowMs));
    this.#do(this.#lane.visibility(this.#clock(this.nowMs), isVisible));
  }

  #clock(atMs: number): number {
    return atMs + this.#skewMs;
  }

  #do(actions: readonly LaneAction[]): void {
    for (const action of actions) {
      if (action.do === 'ask') this.#ask(action.path);
      else if (action.do === 'look') this.#lookUp(action.path);
      else if (action.do === 'open') {
        this.openMs = this.nowMs;
        this.twin.acceptConnection(true, this.#clock(this.nowMs));
      } else if (action.do === 'end') {
        this.ends.push(action);
        this.twin.acceptConnection(false, this.#clock(this.nowMs));
      } else this.#accept(action.message);
    }
  }

  #ask(path: string): void {
    this.requests.push({ atMs: this.nowMs, path });
    const { wayMs, cuts = [], blackouts = [] } = this.#network;
    const arrivesMs = this.nowMs + wayMs();
    const isIn = (spans: readonly Span[]) =>
      spans.some(({ fromMs, toMs }) => arrivesMs >= fromMs && arrivesMs < toMs);
    const fail = (atMs: number) => {
      this.#answer = { atMs, tell: () => this.#lane.failed(this.#clock(this.nowMs), 'cut') };
    };
    if (isIn(cuts)) {
      fail(arrivesMs + wayMs());
      return;
    }
    const found = this.#relay.answer(path, arrivesMs);
    const cut = cuts.find(({ fromMs }) => fromMs > arrivesMs && fromMs < found.atMs);
    if (cut !== undefined) {
      fail(cut.fromMs);
      return;
    }
    const dark = blackouts.find(({ fromMs, toMs }) => toMs > arrivesMs && fromMs < found.atMs);
    const refused = { status: 404, isJson: true, retryMs: null, dateMs: null, bytes: new Uint8Array() };
    const answer = dark === undefined && !isIn(blackouts) ? found.answer : refused;
    this.#answer = {
      atMs: found.atMs + wayMs(),
      tell: () => this.#lane.answered(this.#clock(this.nowMs), answer),
    };
  }

  #lookUp(path: string): void {
    this.looks.push({ atMs: this.nowMs, path });
    const { wayMs, cuts = [], hasIndex = true, index = [] } = this.#network;
    const { lateMs = 0, status = 200 } = index[this.looks.length - 1] ?? {};
    const arrivesMs = this.nowMs + wayMs();
    const isCut = cuts.some(({ fromMs, toMs }) => arrivesMs >= fromMs && arrivesMs < toMs);
    const whole = this.#relay.answer(path, arrivesMs).answer;
    const refused = { ...whole, status, isJson: false, retryMs: 1000 };
    const answer = isCut || !hasIndex ? null : status === 200 ? whole : refused;
    this.#look = {
      atMs: arrivesMs + lateMs + wayMs(),
      tell: () => this.#lane.looked(this.#clock(this.nowMs), answer),
    };
  }

  #accept(message: FromStream): void {
    this.posts.push(message);
    const { twin } = this;
    if (message.kind === 'state') {
      const count = message.state.codes[COUNT]!;
      const frame = this.#frames.get(count);
      if (frame?.seq !== message.state.seq) throw new Error(`no such frame at ${this.nowMs}`);
      this.shown.push({ name: frame.name, atMs: this.nowMs, acceptedMs: frame.atMs });
      twin.acceptState(message.state);
    } else if (message.kind === 'status') twin.acceptStatus(message.status);
    else if (message.kind === 'schema') twin.acceptSchema(message.schema);
    else if (message.kind === 'event') {
      this.events.push({ atMs: this.nowMs, n: message.event.n });
      twin.acceptEvent(message.event);
    } else if (message.kind === 'earlier') {
      const found = message.events.filter(({ n }) => this.events.every((known) => known.n !== n));
      this.events = [...found.map(({ n }) => ({ atMs: this.nowMs, n })), ...this.events];
      this.events.sort((a, b) => a.n - b.n);
      twin.acceptEarlier(message.events, message.isAll);
    } else if (message.kind === 'behind') this.behinds.push({ atMs: this.nowMs, ms: message.ms });
  }
}

/** The value below which this fraction of them lies. */
export function quantile(values: readonly number[], part: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(part * sorted.length))] ?? Number.NaN;
}

/** How often a robot of the lane's tests sends a KEY. */
export const KEY_MS = 4000;

const relays = new Map<string, LaneRelay>();

/** A robot of a minute and a half, and a page that joins. Robots of one story are one: to tell it takes longest. */
export function watch(
  story: Partial<LaneStory>,
  joinsMs: number,
  network: Partial<LaneNetwork> = {},
  seed = 1,
) {
  const random = seeded(seed);
  const whole = { lastsMs: 90_000, keyMs: KEY_MS, ...story };
  const name = JSON.stringify(whole);
  const relay = relays.get(name) ?? new LaneRelay(whole);
  relays.set(name, relay);
  const viewer = new LaneViewer(relay, { wayMs: () => 50 + 150 * random(), ...network }, joinsMs, random);
  return { relay, viewer };
}

/** No frame is shown twice, none older than one before, and no event is told twice. */
export function expectOnce({ shown, events }: LaneViewer, told = ''): void {
  expect(new Set(shown.map(({ name }) => name)).size, told).toBe(shown.length);
  const accepted = shown.map(({ acceptedMs }) => acceptedMs);
  expect(accepted, told).toEqual([...accepted].sort((a, b) => a - b));
  const numbers = events.map(({ n }) => n);
  expect(numbers, told).toEqual([...new Set(numbers)].sort((a, b) => a - b));
}

/** No more requests than this in any ten seconds. */
export function expectFew({ requests }: LaneViewer, most = 14, told = ''): void {
  for (const { atMs } of requests) {
    const next = requests.filter((each) => each.atMs >= atMs && each.atMs < atMs + 10_000);
    expect(next.length, told).toBeLessThanOrEqual(most);
  }
}
