import { useCallback, useEffect, useRef, useState, useSyncExternalStore } from 'react';
import { LatePart } from '../../browser/late_part.ts';
import { firstPaint } from '../../browser/painting.ts';
import type { PastSource } from '../../past/past_source.ts';
import { pastUrl } from '../../relay/addresses.ts';
import { relayChoice } from '../../relay/relay.ts';
import { request } from '../../relay/request.ts';
import { tokenFor } from '../../relay/token.ts';
import { late, onDemand } from '../shell/late.tsx';
import { address, momentIn, queryOf } from '../state/address.ts';
import { isHeard, type RobotLink } from '../state/robot_link.ts';
import { usePresenting } from '../state/viewing.ts';
import { useMore } from '../text/language.ts';
import type { Past } from './past_link.ts';

/** Loaded only if there is a past. */
const PAST = new LatePart(
  () => import('./past_link.ts'),
  () => false,
);

/** The past of a robot that this page may look back on; null if there is none, undefined until that is known or needed. Requested
 *  once the body is drawn, and again whenever the stream opens. */
export function usePast(live: RobotLink, wanted = true): Past | null | undefined {
  const [past, setPast] = useState<Past | null | undefined>(noneYet);
  useEffect(() => {
    if (!wanted || relayChoice().mirror !== null) return;
    let left = false;
    let opened: Past | null = null;
    const atMs = momentIn(address.get()); // before the address follows what is shown
    let asked = false;
    const ask = async () => {
      if (live.client.link.phase !== 'open') asked = false;
      if (asked || opened !== null || !isHeard(live)) return;
      asked = true;
      await firstPaint();
      asked = isHeard(live); // otherwise when the stream is back
      if (!asked) return;
      if (await hasPast(live.twin.robot)) {
        const { openPast } = await PAST.load();
        if (left || opened !== null) return;
        opened = openPast(live, atMs);
        setPast(opened);
      } else if (!left) {
        setPast(null);
        live.faults.recall([]);
      }
    };
    const again = () => void ask();
    const leave = [live.client.onChange(again), live.twin.onChange(again), live.watch.onWord(again)];
    void ask();
    return () => {
      left = true;
      for (const off of leave) off();
      opened?.close();
      setPast(noneYet());
    };
  }, [live, wanted]);
  return past;
}

/** Whether the address has named a moment since the page was opened, and whether it is valid; it is removed once the page is
 *  live. */
export function useMomentNamed(): 'moment' | 'nonsense' | null {
  const named = useSyncExternalStore(address.subscribe, () => {
    const hash = address.get();
    return !queryOf(hash).has('t') ? null : momentIn(hash) === null ? 'nonsense' : 'moment';
  });
  const [once, setOnce] = useState<typeof named>(named);
  if (named !== null && named !== once) setOnce(named);
  return once;
}

/** Why the moment in the address can't be shown; null if it can, or if there is none. */
export function missedMoment(
  named: ReturnType<typeof useMomentNamed>,
  past: Past | null | undefined,
): 'noPast' | 'noMoment' | null {
  if (named === 'nonsense') return 'noMoment';
  return named !== null && past === null ? 'noPast' : null;
}

/** A mirror keeps only the newest state. */
function noneYet(): null | undefined {
  return relayChoice().mirror === null ? undefined : null;
}

/** The robot to show: the past one while the page is in the past, else the live one. After returning from the past, the past
 *  robot stays until a live pose has arrived, because the last live pose is as old as the visit. */
export function useShown(live: RobotLink, past: Past | null | undefined): RobotLink {
  const leaving = useRef(false);
  const follow = useCallback(
    (listener: () => void) => {
      const leave = [live.watch.onWord(listener), past?.controls.onChange(listener)];
      return () => {
        for (const off of leave) off?.();
      };
    },
    [live, past],
  );
  const isPast = useSyncExternalStore(follow, () => {
    const at = past?.controls.playhead.at;
    leaving.current = at === 'past' || (leaving.current && at === 'live' && live.watch.word === null);
    return leaving.current;
  });
  return isPast && past ? past.link : live;
}

async function hasPast(robot: string): Promise<boolean> {
  const url = pastUrl(robot);
  const token = tokenFor(url);
  try {
    const answer = await request(
      url,
      token === undefined ? {} : { headers: { authorization: `Bearer ${token}` } },
    );
    return answer.ok && (await answer.json()).past_ms > 0;
  } catch {
    return false; // requested again when the stream opens next
  }
}

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
