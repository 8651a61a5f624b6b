import { fetchPartsAhead } from '../../browser/late_part.ts';
import type { PastSource } from '../../past/past_source.ts';
import {
  MINUTE_MS,
  PAGE_MS,
  type PastControls,
  type PastSink,
  type PastState,
  type Playhead,
} from '../../past/past_types.ts';
import { Coming } from '../../past/player/around.ts';
import { PastPlayer } from '../../past/player/past_player.ts';
import { OwnTape } from '../../past/player/tape/own_tape.ts';
import { RelayPast } from '../../past/relay/relay_past.ts';
import { pastUrl } from '../../relay/addresses.ts';
import { request } from '../../relay/request.ts';
import { tokenFor } from '../../relay/token.ts';
import { nowMs } from '../../stream/clock.ts';
import { isClaim, type Recorded } from '../../twin/liveness.ts';
import { type LeadState, RobotTwin } from '../../twin/robot.ts';
import { address, momentIn, onLink } from '../state/address.ts';
import { FaultKeeper } from '../state/fault_keeper.ts';
import { forgetOwnAlarms } from '../state/own_alarms.ts';
import { HistoryKeeper, isHeard, type RobotLink } from '../state/robot_link.ts';
import { pastControls, shownMoment } from '../state/viewing.ts';
import { PastWatch } from './past_watch.ts';

/** A robot's past on the page: the controls, and a link to the past robot, from which everything can be drawn. */
export interface Past {
  readonly controls: PastControls;
  readonly source: PastSource;
  readonly link: RobotLink;
  readonly close: () => void;
}

/** The source of a past and the target of its playback. */
export interface Played {
  /** The robot at the shown moment. */
  readonly twin: RobotTwin;
  readonly source: PastSource;
  /** What the page itself has received. */
  readonly own: OwnTape;
  /** Events received over the live stream. */
  readonly heard: () => RobotTwin['events'];
  /** The model to use before the robot has announced one. */
  readonly model: () => string | null;
  /** A recording; null: the past ends in the present. */
  readonly recorded: Recorded | null;
  /** Called when the shown moment jumps, or the available past changes. */
  readonly onLook: (playhead: Playhead) => void;
}

/** Plays a past. `player` and the parts of a `RobotLink` other than the connection; `openAt` follows the address unless `atMs` is
 *  undefined. */
export function playPast(played: Played, atMs: number | null | undefined) {
  const { twin, source, own, heard, recorded } = played;
  const clock = () => player.momentMs;
  const faults = new FaultKeeper(twin, clock, false);
  const minute = new HistoryKeeper(twin);
  const watch = new PastWatch(twin, clock, () => player, recorded === null ? 'PAST' : 'RECORDED');

  let edits = twin.edits;
  const lead = (states: readonly LeadState[]) => {
    edits = twin.edits;
    forgetOwnAlarms(twin, states[0]?.atMs ?? clock()); // crossings in the lead-in are recorded again, at their true times
    twin.acceptLead(states);
  };
  const sink: PastSink = {
    jump: () => {
      twin.forgetEvents();
      faults.begin();
      minute.begin();
      forgetOwnAlarms(twin);
    },
    schema: (schema) => twin.acceptSchema(schema),
    // before a robot announces its model, it is assumed to have had the same body
    model: (sha256) => twin.acceptModel(sha256 ?? played.model()),
    info: (kv) => twin.acceptInfo(kv),
    event: (event) => twin.acceptEvent(event),
    word: (word) => watch.was(word),
    state: (state) => {
      twin.acceptState(shownState(state));
      watch.look();
    },
    lead,
    fill: (schema, states) => minute.history.prepend(schema, states),
  };
  void fetchPartsAhead();
  let frame = 0;
  const draw = () => {
    frame = 0;
    player.tick();
    wake();
  };
  const wake = () => {
    if (frame === 0 && !player.isResting) frame = requestAnimationFrame(draw);
  };
  const player: PastPlayer = new PastPlayer({ source, own, sink, nowMs, schedule, heard, recorded, wake });

  let coming: Coming | null = null;
  const listComing = () => {
    coming ??= player.extend(Coming);
    return player.frame === null ? [] : coming.after(player.frame);
  };
  const look = () => {
    const { at, momentMs } = player.playhead;
    const past = at === 'past';
    played.onLook(player.playhead);
    shownMoment.set(past ? momentMs : null);
    watch.look();
    wake();
    if (past) return;
    cancelAnimationFrame(frame);
    frame = 0;
  };
  const go = (moment: number | null) => {
    if (moment !== null && moment !== Math.ceil(shownMoment.get() ?? -1)) player.openAt(moment);
  };
  const named = () => go(momentIn(address.get()));
  const ends = [
    player.onChange(look),
    twin.onChange(() => {
      if (twin.edits !== edits && twin.lead !== null) lead([...twin.lead]); // judged by the new limits
    }),
    atMs === undefined ? () => {} : onLink(named),
    () => cancelAnimationFrame(frame),
    () => shownMoment.set(null),
    () => pastControls.set(null),
    () => player.close(),
    () => source.close(),
    faults.close.bind(faults),
    minute.close,
  ];
  pastControls.set(player);
  go(atMs ?? recorded?.fromMs ?? null);
  return {
    player,
    link: {
      twin,
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

/** Opens a robot's past beside its live stream, at a moment unless that is null. While the past is shown, the stream delivers
 *  only status and events. */
export function openPast(live: RobotLink, atMs: number | null): Past {
  const { robot } = live.twin;
  const twin = new RobotTwin(robot, nowMs());
  const own = new OwnTape();
  const source = new RelayPast(pastUrl(robot), {
    fetch: request,
    tokenFor,
    nowMs,
    later: (ms, run) => schedule(run, ms),
    isIdle: () => document.hidden || !isHeard(live),
    liveSchema: () => live.twin.schema,
  });
  const limits = () => {
    if (twin.edits !== live.twin.edits) twin.acceptEdits(live.twin.edits);
  };
  const forget = () => {
    if (source.deleted === live.twin.deleted || source.deleted.length === 0) return;
    live.twin.acceptDeleted(source.deleted);
    live.faults.forget(source.deleted);
  };
  const ends = [recordOwn(own, live), live.twin.onChange(limits), () => live.client.rest(false)];
  source.onChange(forget); // first: the player reads the live events
  limits();
  const { player, link, close } = playPast(
    {
      ...{ twin, source, own, recorded: null },
      heard: () => live.twin.events,
      model: () => live.twin.modelHash,
      onLook: ({ at }) => live.client.rest(at === 'past'),
    },
    atMs,
  );
  void recallFaults(source, live);
  const { client, manifestUrl } = live;
  return {
    controls: player,
    source,
    link: { ...link, client, manifestUrl },
    close: () => {
      close();
      for (const end of ends) end();
    },
  };
}

/** Gives the live robot the newest recorded fault, unless the relay has sent it. */
async function recallFaults(source: RelayPast, { twin, faults }: RobotLink): Promise<void> {
  let events: RobotTwin['events'] = [];
  try {
    await source.loadDays({ fromMs: 0, toMs: 0 }); // until it is known how far the past reaches
    const toMs = source.timeline?.toMs ?? 0;
    await source.loadDays({ fromMs: toMs, toMs });
    const fromMs = source.timeline?.marks.findLast(({ level }) => level === 'fault')?.atMs;
    const isIt = ({ at, level }: RobotTwin['events'][number]) =>
      level === 'fault' && at !== null && Math.abs(1000 * at - fromMs!) <= MINUTE_MS;
    if (fromMs !== undefined && !twin.events.some(isIt)) {
      await source.loadIndex({ fromMs, toMs: fromMs + MINUTE_MS - 1 });
      events = source.segmentsIn({ fromMs, toMs: fromMs + PAGE_MS }).flatMap((ref) => ref.events);
    }
  } catch {
    // without an answer, what the relay itself sends must do
  }
  faults.recall(events);
}

export function schedule(run: () => void, afterMs: number): () => void {
  const timer = setTimeout(run, afterMs);
  return () => clearTimeout(timer);
}

/** Records the live stream. Returns a function that stops it. */
function recordOwn(own: OwnTape, { twin, watch, client, faults }: RobotLink): () => void {
  // delayed data is recorded at the time when the relay had it, as in the relay's own past
  const state = () => {
    if (twin.schema !== null && twin.state !== null)
      own.push(twin.schema, twin.state, client.link.behindMs ?? 0);
  };
  let info: ReadonlyMap<string, string> | null = null;
  const change = () => {
    const atMs = faults.nowMs();
    own.model(twin.modelHash, atMs);
    if (twin.info !== info) own.info(twin.info, atMs);
    info = twin.info;
    for (const event of twin.events) own.event(event, atMs);
  };
  const word = () => {
    const { cause, word } = watch.verdict();
    const was =
      cause === 'robot silent' ? 'silent' : word === 'OFFLINE' ? 'offline' : isClaim(word) && 'online';
    if (was) own.word(was, faults.nowMs());
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
