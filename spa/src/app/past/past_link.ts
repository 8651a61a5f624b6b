import { tokenFor } from '../../auth/token.ts';
import { fetchPartsAhead, LatePart } from '../../browser/late_part.ts';
import type { PastSource } from '../../past/past_source.ts';
import type { PastControls, PastSink, PastState } from '../../past/past_types.ts';
import type { Coming } from '../../past/player/coming.ts';
import { OwnTape } from '../../past/player/own_tape.ts';
import { PastPlayer } from '../../past/player/past_player.ts';
import { RelayPast } from '../../past/relay/relay_past.ts';
import { apiUrl } from '../../relay/addresses.ts';
import { nowMs } from '../../stream/clock.ts';
import { isClaim } from '../../twin/liveness.ts';
import { RobotTwin } from '../../twin/robot.ts';
import { FaultKeeper } from '../state/fault_keeper.ts';
import { HistoryKeeper } from '../state/history_keeper.ts';
import { momentIn, pastControls, shownMoment } from '../state/moment.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { isHeard } from './heard.ts';
import { PastWatch } from './past_watch.ts';

/** For the plots of who looks at a joint of then. */
const COMING = new LatePart(() => import('../../past/player/coming.ts'));
/** Nobody waits for it before somebody looks back; by then the relay may be gone. */
const READER = new LatePart(() => import('../../past/relay/past_reader.ts'));

/** A robot's past on the page: the controls, and a link to the robot as it was, which everything can be drawn from. */
export interface Past {
  readonly controls: PastControls;
  readonly source: PastSource;
  readonly link: RobotLink;
  readonly close: () => void;
}

/** Opens the past of a robot beside its live stream, at a moment unless that is null. While the past is shown the stream rests, and listens for status and
 *  events alone. */
export function openPast(live: RobotLink, atMs: number | null): Past {
  const { robot } = live.twin;
  const twin = new RobotTwin(robot, nowMs());
  const clock = () => player.momentMs;
  const faults = new FaultKeeper(twin, clock, false);
  const minute = new HistoryKeeper(twin);
  const watch = new PastWatch(twin, clock, () => player);

  const sink: PastSink = {
    jump: () => {
      twin.forgetEvents();
      faults.begin();
      minute.begin();
    },
    schema: (schema) => twin.acceptSchema(schema),
    // before a robot has told its model it had the same body
    model: (sha256) => twin.acceptModel(sha256 ?? live.twin.modelHash),
    info: (kv) => twin.acceptInfo(kv),
    event: (event) => twin.acceptEvent(event),
    word: (word) => watch.was(word),
    state: (state) => {
      twin.acceptState(shownState(state));
      watch.look();
    },
    fill: (schema, states) => minute.history.prepend(schema, states),
  };
  const own = new OwnTape();
  const source = new RelayPast(apiUrl(`robots/${robot}/past`), {
    fetch: (url, init) => fetch(url, init),
    tokenFor,
    loadReader: () => READER.load(),
    nowMs,
    later: (ms, run) => schedule(run, ms),
    isIdle: () => document.hidden || !isHeard(live),
    liveSchema: () => live.twin.schema,
  });
  void READER.load();
  void fetchPartsAhead();
  const player: PastPlayer = new PastPlayer({
    ...{ source, own, sink, nowMs, schedule },
    heard: () => live.twin.events,
  });

  let coming: Coming | null = null;
  const listComing = () => {
    const part = COMING.value();
    if (part === null) void COMING.load();
    else coming ??= player.extend(part.Coming);
    return player.frame === null ? [] : (coming?.after(player.frame) ?? []);
  };
  const limits = () => {
    if (twin.edits !== live.twin.edits) twin.acceptEdits(live.twin.edits);
  };
  let frame = 0;
  const draw = () => {
    player.tick();
    frame = requestAnimationFrame(draw);
  };
  const look = () => {
    const { at, momentMs } = player.playhead;
    const past = at === 'past';
    live.client.rest(past);
    shownMoment.set(past ? momentMs : null);
    watch.look();
    if (past && frame === 0) frame = requestAnimationFrame(draw);
    if (past || frame === 0) return;
    cancelAnimationFrame(frame);
    frame = 0;
  };
  const go = (moment: number | null) => {
    if (moment !== null && moment !== Math.ceil(shownMoment.get() ?? -1)) player.openAt(moment);
  };
  const named = () => go(momentIn(window.location.hash));
  const ends = [
    recordOwn(own, live),
    live.twin.onChange(limits),
    player.onChange(look),
    () => window.removeEventListener('hashchange', named),
    () => cancelAnimationFrame(frame),
    () => shownMoment.set(null),
    () => pastControls.set(null),
    () => live.client.rest(false),
    () => player.close(),
    () => source.close(),
    faults.close.bind(faults),
    minute.close,
  ];
  window.addEventListener('hashchange', named);
  limits();
  pastControls.set(player);
  go(atMs);
  return {
    controls: player,
    source,
    link: {
      twin,
      client: live.client,
      watch,
      faults,
      minute,
      coming: listComing,
      nowMs: clock,
      resting: () => !player.playhead.playing,
    },
    close: () => {
      for (const end of ends) end();
    },
  };
}

function schedule(run: () => void, afterMs: number): () => void {
  const timer = setTimeout(run, afterMs);
  return () => clearTimeout(timer);
}

/** Records what comes of the live stream. Returns a function that stops it. */
function recordOwn(own: OwnTape, { twin, watch }: RobotLink): () => void {
  const state = () => {
    if (twin.schema !== null && twin.state !== null) own.push(twin.schema, twin.state);
  };
  let info: ReadonlyMap<string, string> | null = null;
  const change = () => {
    const atMs = nowMs();
    own.model(twin.modelHash, atMs);
    if (twin.info !== info) own.info(twin.info, atMs);
    info = twin.info;
    for (const event of twin.events) own.event(event, atMs);
  };
  const word = () => {
    const said = watch.verdict();
    if (said.cause === 'robot silent') own.word('silent', nowMs());
    else if (said.word === 'OFFLINE') own.word('offline', nowMs());
    else if (isClaim(said.word)) own.word('online', nowMs());
  };
  const ends = [twin.onState(state), twin.onChange(change), watch.onWord(word)];
  change();
  state();
  word();
  return () => {
    for (const end of ends) end();
  };
}

function shownState({ schemaId, seq, tS, codes, atMs, lateMs }: PastState) {
  return { schemaId, seq, tS, codes, atMs, lateMs, freshMs: null, bornMs: null, changedMs: atMs };
}
