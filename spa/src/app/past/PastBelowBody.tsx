import { useEffect, useState } from 'react';
import type { PastSource } from '../../past/past_source.ts';
import { late, onDemand } from '../shell/late.tsx';
import { usePresenting } from '../state/presenting.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { useMore } from '../text/language.ts';
import type { Past } from './past_link.ts';
import './no_past.css';

/** Long enough to be read twice, ms. */
const SAID_MS = 15_000;

/** Says, in place of the time line, that the moment in the link can't be shown here. */
export function NoPast({ why }: { why: 'noPast' | 'noMoment' }) {
  const text = useMore();
  const [said, setSaid] = useState(false);
  useEffect(() => {
    const timer = setTimeout(() => setSaid(true), SAID_MS);
    return () => clearTimeout(timer);
  }, []);
  if (said) return null;
  return (
    <p className="no-past" role="status" data-testid="past-note">
      {text[why]}
    </p>
  );
}

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
