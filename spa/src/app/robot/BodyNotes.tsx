import '../shell/styles/tools.css';
import { useMemo } from 'react';
import type { ModelReport } from '../../model/report.ts';
import { LostReadings } from '../../twin/sensors/lost_readings.ts';
import { BalanceLine } from '../balance/BalanceParts.tsx';
import { useNow } from '../shell/now.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { useMore } from '../text/more.ts';
import { ModelFindings } from './ModelFindings.tsx';
import type { ViewTrouble } from './use_body_view.ts';
import { ViewNote } from './ViewNote.tsx';
import { bareWords, missingWords, unreadWords } from './words.ts';

/** Notes about the picture: how it is drawn, which meshes are missing, which joints have no reading, and the sentence about
 *  balance. */
export function BodyNotes(props: {
  link: RobotLink;
  trouble: ViewTrouble | null;
  /** The report of the shown model; null while there is none. */
  report: ModelReport | null;
  choose: (way: '3d' | 'light') => void;
}) {
  const { link, trouble, report, choose } = props;
  useMore();
  const note = report === null ? null : noteOf(report);
  return (
    <>
      {note !== null && (
        <p className="stage-foot" data-testid="model-note">
          {note}
        </p>
      )}
      <div className="stage-views">
        {trouble !== null && <ViewNote trouble={trouble} choose={choose} />}
        <Unread link={link} />
        <BalanceLine link={link} />
      </div>
      {report !== null && <ModelFindings findings={report.findings} />}
    </>
  );
}

/** Names the joints that have no reading now and are shown at their last known position. */
function Unread({ link }: { link: RobotLink }) {
  useNow(500);
  const { schema, state } = link.twin;
  const lost = useMemo(() => (schema === null ? null : new LostReadings(schema)), [schema]);
  const joints = state === null ? [] : (lost?.update(state.codes) ?? []);
  return joints.length === 0 ? null : <p data-testid="unread-note">{unreadWords(joints)}</p>;
}

function noteOf({ bare, missing }: ModelReport): string | null {
  if (bare !== undefined) return bareWords(bare);
  return missing.length > 0 ? missingWords(missing, null) : null;
}
