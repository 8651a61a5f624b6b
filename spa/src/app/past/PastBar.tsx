import { useCallback, useEffect, useState, useSyncExternalStore } from 'react';
import type { PastSource } from '../../past/past_source.ts';
import type { PastControls } from '../../past/past_types.ts';
import { manifestUrl } from '../../relay/addresses.ts';
import { isolated } from '../../twin/names.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { late, onDemand } from '../shell/late.tsx';
import { usePageKeys } from '../shell/page_keys.ts';
import { useFaults } from '../state/fault_keeper.ts';
import { useStore, useTicked } from '../state/hooks.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { usePastText } from '../text/late.ts';
import { faultSentence } from '../words/fault_sentence.ts';
import type { OfferedFile } from './save/Outcome.tsx';
import { chosenOn, pastKeys } from './time_line/line.ts';
import { type BelowTrack, TimeLine } from './time_line/TimeLine.tsx';
import './time_line/past.css';

const MomentSheet = late(async () => (await import('./jump/MomentSheet.tsx')).MomentSheet);
const SaveSheet = late(async () => (await import('./save/SaveSheet.tsx')).SaveSheet, onDemand);

/** Controls below the body for looking back: the time line and, in the past, new faults. `live`: null if there is no live robot;
 *  the other props are for a recording, see `TimeLine`. */
export function PastBar(props: {
  controls: PastControls;
  live: RobotLink | null;
  /** The source of the names at the shown moment. */
  twin: RobotTwin;
  /** What can be saved; null if saving is not possible. */
  source: PastSource | null;
  /** The address of a model's manifest, by its hash; by default, the relay's. */
  manifestUrl?: (sha256: string) => string;
  /** Files of all of it, for other programs. */
  offered?: readonly OfferedFile[];
  /** Only its keyboard shortcuts are active. */
  unseen?: boolean;
  slim?: boolean;
  notes?: BelowTrack | null;
}) {
  const { controls, live, twin, source, manifestUrl: given, offered, unseen = false, ...rest } = props;
  const [saving, setSaving] = useState(false);
  const { robot } = twin;
  const models = useCallback(
    (sha256: string) => given?.(sha256) ?? manifestUrl(robot, sha256),
    [given, robot],
  );
  const save = source === null ? null : () => setSaving(true);
  usePageKeys(() => pastKeys(controls, save));
  const { at } = useSyncExternalStore(controls.onChange, () => controls.playhead);
  const { isJumpOpen } = useStore(chosenOn(controls));
  if (unseen) return null;
  return (
    <>
      {live !== null && at === 'past' && <LiveNews live={live} controls={controls} />}
      <TimeLine controls={controls} onSave={save} {...rest} />
      {isJumpOpen && <MomentSheet controls={controls} twin={twin} />}
      {saving && source !== null && (
        <SaveSheet
          controls={controls}
          source={source}
          manifestUrl={models}
          offered={offered}
          onClose={() => setSaving(false)}
        />
      )}
    </>
  );
}

/** Says that a new fault occurred while the past is shown, with a link to it. */
function LiveNews({ live, controls }: { live: RobotLink; controls: PastControls }) {
  const text = usePastText();
  const [seen, setSeen] = useState<ReadonlySet<string> | null>(null);
  const faults = (useFaults(live.faults) ?? []).filter(
    ({ level, clearedMs }) => level === 'fault' && clearedMs === null,
  );
  useEffect(() => {
    if (seen === null) setSeen(new Set(faults.map(({ key }) => key)));
  }, [seen, faults]);
  const fresh = faults.find(({ key }) => seen !== null && !seen.has(key));
  const said = useTicked(1000, () =>
    fresh === undefined ? '' : faultSentence(live.twin, live.faults.log, fresh, live.faults.nowMs()).said,
  );
  if (fresh === undefined) return null;
  return (
    <p className="past-news" role="alert" data-testid="past-news">
      <span>{text.now(isolated(said))}</span>
      <button type="button" className="text-button" onClick={() => controls.goLive()}>
        {text.live}
      </button>
    </p>
  );
}
