import { useSyncExternalStore } from 'react';
import type { PastControls } from '../../past/past_types.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { LiveNews } from './LiveNews.tsx';
import { usePastKeys } from './time_line/past_keys.ts';
import { type BelowTrack, TimeLine } from './time_line/TimeLine.tsx';

/** What stands under the body for looking back: the time line and, in the past, what goes wrong meanwhile. `live`: null where
 *  nothing is live; the rest is for a recording, see `TimeLine`. */
export function PastBar(props: {
  controls: PastControls;
  live: RobotLink | null;
  /** Only its keys are there. */
  unseen?: boolean;
  slim?: boolean;
  notes?: BelowTrack | null;
}) {
  const { controls, live, unseen = false, ...rest } = props;
  usePastKeys(controls);
  const { at } = useSyncExternalStore(controls.onChange, () => controls.playhead);
  if (unseen) return null;
  return (
    <>
      {live !== null && at === 'past' && <LiveNews live={live} controls={controls} />}
      <TimeLine controls={controls} {...rest} />
    </>
  );
}
