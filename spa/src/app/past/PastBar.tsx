import { useSyncExternalStore } from 'react';
import type { PastControls } from '../../past/past_types.ts';
import { late } from '../shell/late.tsx';
import type { RobotLink } from '../state/robot_link.ts';
import { useStore } from '../state/use_store.ts';
import { LiveNews } from './LiveNews.tsx';
import { momentSheet } from './time_line/jump/moment_sheet.ts';
import { usePastKeys } from './time_line/past_keys.ts';
import { TimeLine } from './time_line/TimeLine.tsx';

const MomentSheet = late(async () => (await import('./time_line/jump/MomentSheet.tsx')).MomentSheet);

/** What stands under the body for looking back: the time line and, in the past, what goes wrong meanwhile. */
export function PastBar({ controls, live }: { controls: PastControls; live: RobotLink }) {
  usePastKeys(controls);
  const { at } = useSyncExternalStore(controls.onChange, () => controls.playhead);
  const sheet = useStore(momentSheet);
  return (
    <>
      {at === 'past' && <LiveNews live={live} controls={controls} />}
      <TimeLine controls={controls} />
      {sheet === controls && <MomentSheet controls={controls} live={live} />}
    </>
  );
}
