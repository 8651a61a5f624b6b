import { useEffect, useState, useSyncExternalStore } from 'react';
import { untilRetry } from '../../../browser/retry.ts';
import { builtModelAt } from '../../../model/files.ts';
import { PastError } from '../../../past/past_source.ts';
import type { PastControls } from '../../../past/past_types.ts';
import { OwnTape } from '../../../past/player/tape/own_tape.ts';
import { type LostParts, RecordingPast } from '../../../past/recording/recording_past.ts';
import { recordingUrl } from '../../../relay/relay.ts';
import { nowMs } from '../../../stream/clock.ts';
import { RobotTwin } from '../../../twin/robot.ts';
import { type Past, playPast, schedule } from '../../past/past_link.ts';
import { address, momentIn } from '../../state/address.ts';
import { loadOwnLimits } from '../../state/limits.ts';
import type { Connection } from '../../state/robot_link.ts';
import { clearTraces, selectJoint } from '../../state/viewing.ts';
import { fetchRecording, type OpenedRecording } from './opened_recording.ts';
import { recordedAs } from './recording_words.ts';

/** A connection that receives nothing and sends nothing. */
const NO_STREAM: Connection = {
  link: {
    ...{ by: 'websocket', phase: 'open', retryAtMs: null, ending: null, grantedHz: null, rateReason: null },
    ...{ hz: 0, roundTripMs: null, lateMs: null, behindMs: null, problem: null },
  },
  onChange: () => () => {},
  wake: () => {},
  wishAll: () => {},
  rest: () => {},
};

const NONE: PastControls['heard'] = [];

/** A recording being played: a `Past`, plus what is missing from it. */
export interface PlayedRecording extends Past {
  readonly source: RecordingPast;
}

/** Plays a recording while the component is shown. `isLinked`: the address names a moment. null before the first effect has
 *  run. */
export function useRecording(opened: OpenedRecording, isLinked: boolean): PlayedRecording | null {
  const [played, setPlayed] = useState<PlayedRecording | null>(null);
  useEffect(() => {
    const made = play(opened, isLinked ? momentIn(address.get()) : undefined);
    setPlayed(made);
    return () => {
      made.close();
      selectJoint(null);
      clearTraces();
      setPlayed(null);
    };
  }, [opened, isLinked]);
  return played;
}

function play(
  { index, files, manifestUrl }: OpenedRecording,
  atMs: number | null | undefined,
): PlayedRecording {
  const twin = new RobotTwin(index.robot, nowMs());
  loadOwnLimits(twin);
  const source = new RecordingPast(index, { files, later: (ms, run) => schedule(run, ms) });
  const firstMs = Math.min(Math.max(atMs ?? 0, index.fromMs), index.toMs);
  const near = source.segmentsIn({ fromMs: firstMs, toMs: firstMs })[0] ?? index.segments[0];
  const model = near?.model ?? index.models[0] ?? null;
  // beside the segment that refers to it
  if (model !== null) builtModelAt(manifestUrl(model)).catch(() => {}); // the caller tries again and reports the error
  const { player, link, close } = playPast(
    {
      ...{
        twin,
        source,
        own: new OwnTape(),
        recorded: recordedAs(source.span, (momentMs) => source.isLostAt(momentMs)),
      },
      heard: () => NONE,
      model: () => index.models[0] ?? null,
      onLook: () => {},
    },
    atMs,
  );
  return { source, controls: player, link: { ...link, client: NO_STREAM, manifestUrl }, close };
}

/** The parts of a recording that can't be played. The component is redrawn when that changes. */
export function useLost(source: RecordingPast): LostParts {
  return useSyncExternalStore(source.onChange, () => source.lost);
}

/** The recording that this page was exported with, or the reason that it can't be read; null while it is loading. */
export function useFetched(wanted: boolean): OpenedRecording | Error | null {
  const [fetched, setFetched] = useState<OpenedRecording | Error | null>(null);
  useEffect(() => {
    const url = recordingUrl();
    if (!wanted || url === null) return;
    let left = false;
    const fetchIt = async () => {
      for (let failures = 1; !left; failures += 1) {
        const found = await fetchRecording(url).catch((error: unknown) => asError(error));
        if (!left) setFetched(found);
        if (!(found instanceof PastError && found.why === 'away')) return;
        await untilRetry(failures);
      }
    };
    void fetchIt();
    return () => {
      left = true;
    };
  }, [wanted]);
  return fetched;
}

function asError(error: unknown): Error {
  return error instanceof Error ? error : new Error(String(error));
}
