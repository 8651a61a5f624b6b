import { useEffect, useState, useSyncExternalStore } from 'react';
import { builtModelAt } from '../../../model/files.ts';
import type { PastControls } from '../../../past/past_types.ts';
import { OwnTape } from '../../../past/player/tape/own_tape.ts';
import { type LostParts, RecordingPast } from '../../../past/recording/recording_past.ts';
import { nowMs } from '../../../stream/clock.ts';
import { RobotTwin } from '../../../twin/robot.ts';
import { type Past, playPast, schedule } from '../../past/past_link.ts';
import { momentIn } from '../../state/moment.ts';
import { loadOwnLimits } from '../../state/own_limits.ts';
import type { Connection } from '../../state/robot_link.ts';
import { selectJoint } from '../../state/selection.ts';
import { clearTraces } from '../../state/traces.ts';
import type { OpenedRecording } from './opened_recording.ts';
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
    const made = play(opened, isLinked ? momentIn(window.location.hash) : undefined);
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
