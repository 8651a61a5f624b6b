import { Suspense, useCallback, useState, useSyncExternalStore } from 'react';
import type { PastSource } from '../../past/past_source.ts';
import type { PastControls } from '../../past/past_types.ts';
import { manifestUrl } from '../../relay/addresses.ts';
import { late, onDemand } from '../shell/late.tsx';
import type { RobotLink } from '../state/robot_link.ts';
import { LiveNews } from './LiveNews.tsx';
import { usePastKeys } from './time_line/past_keys.ts';
import { TimeLine } from './time_line/TimeLine.tsx';

const SaveSheet = late(async () => (await import('./save/SaveSheet.tsx')).SaveSheet, onDemand);

/** What stands under the body for looking back: the time line and, in the past, what goes wrong meanwhile. `source`: what can be
 *  saved; null where nothing is. */
export function PastBar(props: { controls: PastControls; live: RobotLink; source: PastSource | null }) {
  const { controls, live, source } = props;
  const [saving, setSaving] = useState(false);
  const { robot } = live.twin;
  const models = useCallback((sha256: string) => manifestUrl(robot, sha256), [robot]);
  const save = source === null ? null : () => setSaving(true);
  usePastKeys(controls, save);
  const { at } = useSyncExternalStore(controls.onChange, () => controls.playhead);
  return (
    <>
      {at === 'past' && <LiveNews live={live} controls={controls} />}
      <TimeLine controls={controls} onSave={save} />
      {saving && source !== null && (
        <Suspense fallback={null}>
          <SaveSheet
            controls={controls}
            source={source}
            manifestUrl={models}
            onClose={() => setSaving(false)}
          />
        </Suspense>
      )}
    </>
  );
}
