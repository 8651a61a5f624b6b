import { useSyncExternalStore } from 'react';
import type { PastControls } from '../../past/past_types.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { late } from '../shell/late.tsx';
import type { RobotLink } from '../state/robot_link.ts';
import { useStore } from '../state/use_store.ts';
import { LiveNews } from './LiveNews.tsx';
import { momentSheet } from './time_line/jump/moment_sheet.ts';
import { usePastKeys } from './time_line/past_keys.ts';
import { type BelowTrack, TimeLine } from './time_line/TimeLine.tsx';

const MomentSheet = late(async () => (await import('./time_line/jump/MomentSheet.tsx')).MomentSheet);

/** What stands under the body for looking back: the time line and, in the past, what goes wrong meanwhile. `live`: null where
 *  nothing is live; the rest is for a recording, see `TimeLine`. */
export function PastBar(props: {
  controls: PastControls;
  live: RobotLink | null;
  /** Whose names are those of what was. */
  twin: RobotTwin;
  /** Only its keys are there. */
  unseen?: boolean;
  slim?: boolean;
  notes?: BelowTrack | null;
}) {
  const { controls, live, twin, unseen = false, ...rest } = props;
  usePastKeys(controls);
  const { at } = useSyncExternalStore(controls.onChange, () => controls.playhead);
  const sheet = useStore(momentSheet);
  if (unseen) return null;
  return (
    <>
      {live !== null && at === 'past' && <LiveNews live={live} controls={controls} />}
      <TimeLine controls={controls} {...rest} />
      {sheet === controls && <MomentSheet controls={controls} twin={twin} />}
    </>
  );
}
