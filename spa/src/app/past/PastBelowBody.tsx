import type { PastSource } from '../../past/past_source.ts';
import { late, onDemand } from '../shell/late.tsx';
import { usePresenting } from '../state/presenting.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { NoPast } from './NoPast.tsx';
import type { Past } from './past_link.ts';

const PastBar = late(async () => (await import('./PastBar.tsx')).PastBar, onDemand);

/** Shown below the body of a robot that may have a past: the playback controls, and the reason that a linked moment can't be
 *  shown. */
export function PastBelowBody(props: {
  live: RobotLink;
  past: Past | null | undefined;
  missed: 'noPast' | 'noMoment' | null;
  /** What can be saved; null if saving is not possible. */
  source: PastSource | null;
}) {
  const { live, past, missed, source } = props;
  if (usePresenting()) return null;
  return (
    <>
      {missed !== null && <NoPast why={missed} />}
      {past && <PastBar controls={past.controls} live={live} twin={live.twin} source={source} />}
    </>
  );
}
