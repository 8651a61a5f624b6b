import { useSyncExternalStore } from 'react';
import type { PastControls } from '../../past/past_types.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { LiveNews } from './LiveNews.tsx';
import { usePastKeys } from './time_line/past_keys.ts';
import { TimeLine } from './time_line/TimeLine.tsx';

/** What stands under the body for looking back: the time line and, in the past, what goes wrong meanwhile. */
export function PastBar({ controls, live }: { controls: PastControls; live: RobotLink }) {
  usePastKeys(controls);
  const { at } = useSyncExternalStore(controls.onChange, () => controls.playhead);
  return (
    <>
      {at === 'past' && <LiveNews live={live} controls={controls} />}
      <TimeLine controls={controls} />
    </>
  );
}
