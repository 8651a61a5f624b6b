import { readAtMost } from '../../kit.ts';
import type { LaneHandlers, OpenLane } from '../lane_port.ts';
import type { LaneAnswer } from './answers.ts';
import { Lane, type LaneAction } from './lane.ts';
import { LookBack } from './missed_events.ts';

/** The address of a robot's parts. `pastUrl`: `…/robots/{robot}/past`. `view`: null: as the relay says. */
interface LaneAddress {
  readonly pastUrl: string;
  readonly robot: string;
  readonly view: string | null;
}

const ADDRESS = /^(.*\/([^/]+)\/past)(?:\/([a-z0-9][a-z0-9-]{0,62}))?$/;

/** Parses a lane's address. `lane`: the address of a robot's past or, below it, of a view's past. `streamUrl`: the stream whose
 *  relay named the lane, else null. The lane is then resolved relative to it, and must have its origin and lie below its robot's
 *  path. */
export function readLaneAddress(lane: string, streamUrl: string | undefined): LaneAddress | null {
  const base = streamUrl?.replace(/^ws/, 'http');
  try {
    const { origin, pathname } = new URL(lane, base);
    const [, pastUrl, robot, view] = ADDRESS.exec(origin + pathname) ?? [];
    if (pastUrl === undefined || robot === undefined) return null;
    if (base !== undefined && (view === undefined || pastUrl !== new URL('past', base).href)) return null;
    return { pastUrl, robot, view: view ?? null };
  } catch {
    return null;
  }
}

/** The longest answer is a segment: 1 MiB each of header and records, plus some overhead. */
const BYTES_MAX = 3_000_000;
/** The maximum interval between checks for due work: statuses are sent twice a second. */
const TICK_MS = 250;
const LEAST_WAIT_MS = 1;

/** Searches that one lane leaves unfinished continue in the next: a worker reads only one robot. */
const back = new LookBack(Math.random);

/** Reads a robot in parts. `url`: see `Action`. No token or custom header is sent, because other origins would then need a
 *  preflight before each request. Same interface as in `sse.ts`. */
export function openEventStream(url: string, _token: unknown, handlers: LaneHandlers): OpenLane {
  const [lane = '', streamUrl] = url.split(' ');
  const address = readLaneAddress(lane, streamUrl);
  if (address !== null) return openLane(address, handlers);
  queueMicrotask(() => handlers.closed(1006, 'the address is not one for segments'));
  return { setVisible: () => {}, wake: () => {}, close: () => {} };
}

function openLane({ pastUrl, robot, view }: LaneAddress, handlers: LaneHandlers): OpenLane {
  const { nowMs, hz, isVisible, before } = handlers;
  const lane = new Lane({ robot, view, hz, isVisible, before, random: Math.random, back });
  let request = new AbortController();
  let beside = new AbortController();
  let timer: ReturnType<typeof setTimeout> | undefined;
  let isClosed = false;

  const close = () => {
    isClosed = true;
    clearTimeout(timer);
    request.abort();
    beside.abort();
  };
  const perform = (actions: readonly LaneAction[]): void => {
    for (const action of actions) {
      if (isClosed) return;
      if (action.do === 'post') handlers.post(action.message);
      else if (action.do === 'open') handlers.opened();
      else if (action.do === 'ask') ask(action.path);
      else if (action.do === 'look') look(action.path);
      else {
        close();
        handlers.closed(action.code, action.reason);
      }
    }
    if (isClosed) return;
    clearTimeout(timer);
    const waitMs = Math.min(TICK_MS, Math.max(LEAST_WAIT_MS, lane.nextMs - nowMs()));
    timer = setTimeout(() => perform(lane.tick(nowMs())), waitMs);
  };
  const ask = (path: string): void => {
    request.abort();
    request = new AbortController();
    const { signal } = request;
    const tell = (then: () => readonly LaneAction[]) => !signal.aborted && perform(then());
    let headMs = Number.NaN;
    const headCame = () => {
      headMs = nowMs();
    };
    get(pastUrl + path, signal, headCame).then(
      (answer) => tell(() => lane.answered(nowMs(), answer, headMs)),
      (error: unknown) =>
        tell(() => lane.failed(nowMs(), error instanceof Error ? error.message : 'no answer')),
    );
  };
  const look = (path: string): void => {
    beside.abort();
    beside = new AbortController();
    const { signal } = beside;
    get(pastUrl + path, signal, () => {}).then(
      (answer) => !signal.aborted && perform(lane.looked(nowMs(), answer)),
      () => !signal.aborted && perform(lane.looked(nowMs(), null)),
    );
  };
  perform(lane.start(nowMs()));
  return {
    setVisible: (visible) => perform(lane.visibility(nowMs(), visible)),
    wake: () => perform(lane.wake(nowMs())),
    close,
  };
}

async function get(url: string, signal: AbortSignal, headCame: () => void): Promise<LaneAnswer> {
  const { status, headers, body } = await fetch(url, { signal });
  headCame();
  const isJson = headers.get('content-type')?.startsWith('application/json') ?? false;
  const bytes = await readAtMost(body, BYTES_MAX);
  if (bytes === null) throw new RangeError(`an answer of more than ${BYTES_MAX} bytes`);
  return { status, isJson, retryMs: retryMsOf(headers), dateMs: dateMsOf(headers), bytes };
}

function retryMsOf(headers: Headers): number | null {
  const ms = Number(headers.get('retry-ms') ?? Number.NaN);
  const s = Number(headers.get('retry-after') ?? Number.NaN);
  if (ms >= 0) return ms;
  return s >= 0 ? 1000 * s : null;
}

/** Not exposed in answers from another origin. */
function dateMsOf(headers: Headers): number | null {
  const ms = Date.parse(headers.get('date') ?? '') + 1000 * Number(headers.get('age') ?? 0);
  return Number.isFinite(ms) ? ms : null;
}
