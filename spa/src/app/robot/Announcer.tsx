import { useEffect, useState } from 'react';
import { OverlayReader } from '../../twin/overlay/reader.ts';
import { BALANCE, mayTell } from '../balance/BalanceParts.tsx';
import type { RobotLink } from '../state/robot_link.ts';
import { AsAnyone } from './AsAnyone.tsx';
import { type Announcement, announcement } from './announcement.ts';

/** Least time between two announcements to screen readers. */
const EVERY_MS = 5000;
/** How often the announcement is rebuilt and compared with the previous one. */
const LOOK_MS = 500;
/** Announcements include everything, whatever the visible overlay shows. */
const ALL = { shown: 'pos', lens: false, forces: true, level: true, load: 'off' } as const;

/** The sentence about balance, and the coarser text that triggers a new announcement; null if there is none. */
function balance(link: RobotLink): Announcement | null {
  if (!mayTell(link)) return null;
  void BALANCE.load();
  return BALANCE.value()?.spokenStance(link) ?? null;
}

/** Announces the state of the robot to screen readers: when its gist changes, but at most every 5 s. */
export function Announcer({ link }: { link: RobotLink }) {
  const [said, setSaid] = useState('');
  useEffect(() => {
    let reader: OverlayReader | null = null;
    let gist = '';
    let saidMs = Number.NEGATIVE_INFINITY;
    const look = () => {
      const { schema, state, limits, name } = link.twin;
      if (schema !== null && reader?.schema !== schema) reader = new OverlayReader(schema);
      const known = schema !== null && state !== null && limits !== null;
      const now = announcement({
        name,
        verdict: link.watch.verdict(),
        ending: link.client.link.ending,
        behindMs: link.client.link.behindMs,
        readings: known ? (reader?.read(state.codes, limits, ALL) ?? null) : null,
        faults: link.faults.faults() ?? [],
        balance: balance(link),
      });
      if (now.gist === gist || performance.now() - saidMs < EVERY_MS) return;
      gist = now.gist;
      saidMs = performance.now();
      setSaid(now.text);
    };
    const timer = setInterval(look, LOOK_MS);
    return () => clearInterval(timer);
  }, [link]);
  return (
    <>
      <AsAnyone />
      <p className="unseen" role="status" aria-live="polite" data-testid="spoken">
        {said}
      </p>
    </>
  );
}
