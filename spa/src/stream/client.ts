import { Close, revived } from '@posecast/wire';
import { Emitter } from '../kit.ts';
import { request, signInNeeded } from '../relay/request.ts';
import { onAccountToken, tokenFor } from '../relay/token.ts';
import type { RobotTwin } from '../twin/robot.ts';
import { countSleep, nowMs } from './clock.ts';
import { takeStream } from './early_stream.ts';
import type { Ending, FromStream, Phase, Problem, ToStream } from './messages.ts';
import type { Transport } from './transport.ts';

/**
 * Whether this page can be seen: its tab is in front and, where it is embedded in another page, its frame is scrolled into view.
 * A hidden page requests no poses from the relay, and gives back what a browser has few of.
 */
export class PageVisibility {
  #onScreen = true;
  #seen: boolean;
  readonly #tell: (seen: boolean) => void;
  readonly #leave = new AbortController();

  /** `tell` is called at every change, but not for the first value (see `visible`). */
  constructor(tell: (seen: boolean) => void) {
    this.#tell = tell;
    this.#seen = !document.hidden;
    const { signal } = this.#leave;
    document.addEventListener('visibilitychange', this.#look, { signal });
    if (typeof IntersectionObserver === 'undefined') return;
    // Without an explicit root, it observes the viewport of the outermost page, even from inside an iframe.
    const observer = new IntersectionObserver((entries) => {
      this.#onScreen = entries.at(-1)?.isIntersecting ?? true;
      this.#look();
    });
    observer.observe(document.documentElement);
    signal.addEventListener('abort', () => observer.disconnect());
  }

  get visible(): boolean {
    return this.#seen;
  }

  close(): void {
    this.#leave.abort();
  }

  readonly #look = (): void => {
    const seen = !document.hidden && this.#onScreen;
    if (seen === this.#seen) return;
    this.#seen = seen;
    this.#tell(seen);
  };
}

/** State of the connection for the page. Every change makes a new object, so compare by identity. */
export interface Link {
  /** The transport in use, or the one being tried. */
  by: Transport;
  phase: Phase;
  retryAtMs: number | null;
  ending: Ending | null;
  /** The frame rate that the relay granted, and the reason if it is lower than requested. */
  grantedHz: number | null;
  rateReason: string | null;
  /** Measured frames per second. */
  hz: number;
  roundTripMs: number | null;
  /** How late the relay's data arrives, at most; null: unknown. */
  lateMs: number | null;
  /** The delay of the picture; null: none. */
  behindMs: number | null;
  problem: Problem | null;
}

const UNKNOWN: Link = {
  by: 'websocket',
  phase: 'connecting',
  retryAtMs: null,
  ending: null,
  grantedHz: null,
  rateReason: null,
  hz: 0,
  roundTripMs: null,
  lateMs: null,
  behindMs: null,
  problem: null,
};

/** Whether the relay's newest answer is that it knows no such robot, or hides it. */
export function isAbsent({ ending }: Pick<Link, 'ending'>): boolean {
  return ending?.code === Close.ABSENT;
}

/** By then the table, which is written a few times a second, also shows a new pose. */
const ALL_SHOW_MS = 300;

/** How far the measured delay of a lane may move away from the shown second, ms. */
const STEADY_MS = 750;

/** The delay to show: the previous value, as long as its whole second is nearly right. This keeps the displayed seconds from
 *  flickering with the tenths, which vary from part to part. */
export function steadyBehindMs(beforeMs: number | null, ms: number | null): number | null {
  if (beforeMs === null || ms === null) return ms;
  return Math.abs(ms - 1000 * Math.round(beforeMs / 1000)) < STEADY_MS ? beforeMs : ms;
}

/** The page's end of the stream: feeds the worker's messages to the twin, and tells the worker whether the page is visible. */
export class StreamClient {
  link: Link = UNKNOWN;
  readonly #twin: RobotTwin;
  readonly #url: string;
  readonly #worker: Worker;
  readonly #changed = new Emitter();
  readonly #leave = new AbortController();
  #seen = true;
  #resting = false;
  /** The connection with this delay has ended, but its picture stays until another replaces it. */
  #leavesBehind = false;
  /** When the first pose arrived after that; null: none yet. */
  #nowSinceMs: number | null = null;

  /** `lane`: where segments are read instead of opening a socket; null: nowhere. */
  constructor(twin: RobotTwin, url: string, hz: number, lane: string | null = null) {
    this.#twin = twin;
    this.#url = url;
    const { worker, messages } = takeStream(url, hz, lane);
    this.#worker = worker;
    this.#worker.onmessage = (event: MessageEvent<FromStream>) => this.#accept(event.data);
    this.#worker.onerror = (event) => {
      this.#set({
        problem: { what: 'worker', detail: event.message || 'it could not start' },
      });
    };
    for (const message of messages) this.#accept(message);
    const visibility = new PageVisibility((seen) => {
      this.#seen = seen;
      this.#watch();
      if (seen) this.wake();
    });
    this.#seen = visibility.visible;
    this.#watch();
    const { signal } = this.#leave;
    const wake = () => this.wake();
    signal.addEventListener('abort', () => visibility.close());
    signal.addEventListener(
      'abort',
      onAccountToken(() => this.#tell({ kind: 'token', token: tokenFor(url) })),
    );
    window.addEventListener('online', wake, { signal });
    window.addEventListener('pageshow', (event) => event.persisted && wake(), { signal });
  }

  readonly onChange = this.#changed.on;

  /** Reconnects now instead of waiting for the next retry. `isAsked`: the viewer asked for it. */
  wake(isAsked = false): void {
    this.#tell({ kind: 'wake', sleptMs: countSleep(), isAsked });
  }

  /** Requests only status and events while nobody looks at the live picture, or poses again. */
  rest(resting: boolean): void {
    if (this.#resting === resting) return;
    this.#resting = resting;
    this.#watch();
  }

  #watch(): void {
    const wanted = this.#watches;
    this.#tell({ kind: 'visible', wanted, seen: this.#seen });
    this.#twin.acceptWatching(wanted, nowMs());
  }

  /** The shown pose is no longer called live, as of `sinceMs`. */
  doubt(sinceMs: number): void {
    this.#tell({ kind: 'doubt', sinceMs });
  }

  /** Requests the full frame rate again after the relay or a slow network lowered it. */
  wishAll(): void {
    this.#tell({ kind: 'wish-all' });
  }

  close(): void {
    this.#leave.abort();
    this.#worker.onmessage = null;
    this.#tell({ kind: 'close' });
  }

  get #watches(): boolean {
    return this.#seen && !this.#resting;
  }

  #leaveBehind(): void {
    if (!this.#leavesBehind) return;
    this.#leavesBehind = false;
    this.#set({ behindMs: null });
  }

  /** A failed stream does not say why; after plain HTTP has failed as well, this asks whether people must sign in. */
  #checkSignIn({ by, phase, ending }: Extract<FromStream, { kind: 'link' }>): void {
    if (phase === 'open' && signInNeeded.get()) signInNeeded.set(false);
    if (by !== 'events' || phase !== 'waiting' || ending?.code !== 1006 || signInNeeded.get()) return;
    const robot = this.#url.replace(/^ws/, 'http').replace(/\/live$/, '');
    request(robot, { method: 'HEAD' }).catch(() => {}); // it has set `signInNeeded`, or there is no network
  }

  #tell(message: ToStream): void {
    this.#worker.postMessage(message);
  }

  #accept(message: FromStream): void {
    const twin = this.#twin;
    switch (message.kind) {
      case 'state':
        twin.acceptState(message.state);
        this.#tell({ kind: 'taken' });
        this.#nowSinceMs ??= nowMs();
        if (nowMs() - this.#nowSinceMs >= ALL_SHOW_MS) this.#leaveBehind();
        return;
      case 'status':
        twin.acceptStatus(message.status);
        if (!this.#watches) this.#leaveBehind(); // no pose will arrive
        return;
      case 'schema':
        twin.acceptSchema(revived(message.schema));
        if (this.link.problem?.what === 'schema') this.#set({ problem: null });
        return;
      case 'event':
        twin.acceptEvent(message.event);
        return;
      case 'earlier':
        twin.acceptEarlier(message.events, message.isAll);
        return;
      case 'info':
        twin.acceptInfo(message.kv);
        return;
      case 'model':
        twin.acceptModel(message.hash);
        return;
      case 'rate':
        this.#set({ grantedHz: message.hz, rateReason: message.reason });
        return;
      case 'pace':
        this.#set({ hz: message.hz, roundTripMs: message.roundTripMs, lateMs: message.lateMs });
        return;
      case 'link':
        this.#checkSignIn(message);
        if (this.link.by === 'segments' && message.by !== 'segments') twin.acceptCatchUp();
        if (message.by !== 'segments' && message.phase === 'open') twin.hasAllEvents = true; // it reports them
        if (message.moves) {
          if (message.phase === 'open') twin.acceptMove();
        } else {
          // also after a move that took too long: what the old relay sent may no longer be true
          if (message.phase === 'open' && this.link.phase !== 'open') twin.acceptConnection(false, nowMs());
          twin.acceptConnection(message.phase === 'open', nowMs(), message.phase === 'connecting');
        }
        this.#set({
          by: message.by,
          phase: message.phase,
          retryAtMs: message.retryAtMs,
          ending: message.phase === 'open' ? null : (message.ending ?? this.link.ending),
          // the next connection may be to another relay; a worker that has failed stays failed
          ...(message.phase === 'connecting' && this.link.problem?.what !== 'worker'
            ? { problem: null }
            : {}),
        });
        return;
      case 'held-up':
        twin.acceptHoldUp(message.fromMs, message.toMs);
        return;
      case 'behind':
        this.#leavesBehind = message.ms === null && this.link.behindMs !== null;
        this.#nowSinceMs = null;
        if (!this.#leavesBehind) this.#set({ behindMs: steadyBehindMs(this.link.behindMs, message.ms) });
        return;
      case 'problem':
        this.#set({ problem: message.problem });
        return;
    }
  }

  #set(changed: Partial<Link>): void {
    this.link = { ...this.link, ...changed };
    this.#changed.emit();
  }
}
