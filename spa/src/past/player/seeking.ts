import { MINUTE_MS } from '../past_types.ts';
import type { Fill } from './around.ts';
import type { KeyPageFetcher } from './key_page_fetcher.ts';
import { LINK_NOTE_MS, type PastPorts, type PlayheadState } from './playhead_state.ts';
import type { Projector } from './projector.ts';
import { pageBefore } from './tape/happenings.ts';
import type { Loads } from './tape/loads.ts';
import { LOADS_MAX, type Reel } from './tape/reel.ts';
import type { Tape, TapeFrame } from './tape/tape.ts';

/** The moment in a link counts as not kept unless something was recorded within this time of it, ms. */
const LINK_APART_MS = 10_000;

/** State shared by seeking, playing and visits to faults. */
export interface PlayerParts {
  readonly ports: PastPorts;
  readonly state: PlayheadState;
  readonly tape: Tape;
  readonly loads: Loads;
  readonly reel: Reel;
  readonly projector: Projector;
  readonly keyFetcher: KeyPageFetcher;
  readonly fill: Fill;
  /** Shows the requested moment as far as it is loaded, and fetches the rest. */
  readonly work: () => void;
  readonly goLive: () => void;
}

/** Goes to a moment, and cancels the loading of segments for other moments. */
export function jump(parts: PlayerParts, momentMs: number): void {
  const { ports, state, loads, keyFetcher, work } = parts;
  state.scrubbing = null;
  keyFetcher.stop();
  want(parts, momentMs);
  const near = { fromMs: momentMs - MINUTE_MS, toMs: momentMs + MINUTE_MS / 2 };
  loads.keepOnly(ports.source.segmentsIn(near));
  work();
}

/** Makes a moment the requested one. Plots are no longer filled for the previous one. */
export function want(parts: PlayerParts, momentMs: number): void {
  parts.fill.stop();
  parts.state.want(momentMs);
}

/** Shows the requested moment as far as it is loaded: exactly when at rest, approximately while a finger drags. */
export function showWanted(parts: PlayerParts, momentMs: number): void {
  if (parts.state.scrubbing === null) showAt(parts, momentMs);
  else scrub(parts, momentMs);
}

/** If a moment is not kept, goes to the nearest one that is; if a link's moment is in the future, goes live. Returns whether it
 *  moved. */
export function leaveUnkept(parts: PlayerParts, momentMs: number): boolean {
  const { ports, state, goLive } = parts;
  const keptMs = state.keptMs(momentMs);
  if (state.timeline === null || keptMs === momentMs) return false;
  const { askedMs } = state;
  if (askedMs !== null && askedMs > state.nowMs && state.recorded === null) {
    goLive();
    state.askedMs = askedMs;
    state.say('not-come');
    ports.schedule(() => state.publish(), LINK_NOTE_MS);
    return true;
  }
  if (askedMs !== null) state.say('not-kept');
  else if (keptMs > momentMs) state.say('resumed');
  jump(parts, keptMs);
  return true;
}

/** Shows the frame of a moment if it is loaded, else the first pose of a nearby segment. */
function scrub(parts: PlayerParts, momentMs: number): void {
  const { reel, projector } = parts;
  const { frame, situation } = reel.at(momentMs);
  const { cursor } = projector;
  if (frame === null || situation === null) showKey(parts, momentMs);
  else if (frame.seq !== cursor?.seq || frame.runId !== cursor.runId)
    projector.show(frame, momentMs, situation);
}

/** Shows a moment exactly as soon as all of it is loaded; until then, the first pose of a nearby segment. */
function showAt(parts: PlayerParts, momentMs: number): void {
  if (leaveUnkept(parts, momentMs)) return;
  const { state, reel, projector, fill } = parts;
  const { askedMs } = state;
  const { frame, situation, pending, isDamaged } = reel.at(momentMs);
  for (const each of pending.slice(0, LOADS_MAX)) each.begin();
  const isUnknown = state.timeline === null && (frame === null || askedMs !== null);
  if (situation === null || isUnknown) {
    state.wait(pending);
    showKey(parts, momentMs);
    return;
  }
  if (askedMs !== null && situation.word === 'online' && goNearer(parts, momentMs, frame)) return;
  const shownMs = Math.max(momentMs, frame?.atMs ?? 0);
  projector.show(frame, shownMs, situation);
  state.arrive(shownMs);
  if (isDamaged) state.say('damaged');
  const isApart = frame === null || Math.abs((askedMs ?? momentMs) - frame.atMs) > LINK_APART_MS;
  if (askedMs !== null && isApart && situation.word === 'online') state.say('not-kept');
  if (frame !== null) fill.soon(frame);
  void recallFaults(parts, shownMs);
}

/** Moves from a link's moment to the nearest recorded one, before or after it. Does nothing if `before` is near enough. Returns
 *  whether it moved. */
function goNearer(parts: PlayerParts, momentMs: number, before: TapeFrame | null): boolean {
  const agoMs = before === null ? Number.POSITIVE_INFINITY : momentMs - before.atMs;
  if (agoMs <= LINK_APART_MS) return false;
  const nextMs = parts.reel.nextMs(null, momentMs);
  const nearestMs = nextMs !== null && nextMs - momentMs < agoMs ? nextMs : (before?.atMs ?? momentMs);
  if (nearestMs === momentMs) return false;
  jump(parts, nearestMs);
  return true;
}

/** Fetches the recent faults of a moment if they are on another page, and shows the moment again with them. */
async function recallFaults(parts: PlayerParts, shownMs: number): Promise<void> {
  const { ports, state, loads } = parts;
  const page = pageBefore(ports.source, shownMs);
  const { wants } = state;
  if (page === null || loads.stateOf(`index ${page}`) === 'ready') return;
  await loads.index(page);
  if (wants !== state.wants || !state.isPast || state.steps !== 0) return;
  if (loads.stateOf(`index ${page}`) === 'ready') jump(parts, state.clock.momentMs);
}

/** Shows the first pose of a segment near a moment. */
function showKey(parts: PlayerParts, momentMs: number): void {
  const { ports, loads, projector, work } = parts;
  const { source } = ports;
  const pose = source.keyAt(momentMs);
  if (pose === null) return;
  const reader = loads.knownReader(pose.schema);
  if (reader === null) {
    loads.reader(pose.schema).then(work, () => undefined);
    return;
  }
  projector.showKey(pose, reader, () => {
    const refs = source.segmentsIn({ fromMs: pose.atMs - MINUTE_MS, toMs: pose.atMs });
    return refs.flatMap(({ words }) => words).findLast(({ atMs }) => atMs <= pose.atMs)?.word ?? null;
  });
}
