import '../shell/styles/tools.css';
import { useMemo } from 'react';
import type { ModelReport } from '../../model/report.ts';
import { listUnmoving } from '../../twin/kinematic_tree.ts';
import { isolated } from '../../twin/names.ts';
import { LostReadings } from '../../twin/sensors/last_readings.ts';
import { BalanceLine } from '../balance/BalanceParts.tsx';
import { useTicked } from '../state/hooks.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { more, useMore } from '../text/language.ts';
import type { ViewTrouble } from './use_body_view.ts';

const VIEW_WORDS = {
  lost: 'viewLost',
  pixels: 'viewPixels',
  detail: 'viewDetail',
  light: 'viewLight',
  'light-pixels': 'viewLightPixels',
  slow: 'viewSlow',
  'given-up': 'viewGivenUp',
  chosen: 'viewChosen',
} as const;

/** Why the body is not drawn in full 3D quality. */
function viewWords(trouble: keyof typeof VIEW_WORDS): string {
  return more()[VIEW_WORDS[trouble]];
}

/** Says that these joints have no reading and are shown at their last known position. Names at most four. */
export function unreadWords(joints: readonly string[]): string {
  return more().noReadingOf(joints.slice(0, 4).map(isolated), Math.max(0, joints.length - 4));
}

/** Names the readings and the joints of a model that no reading moves, at most three of each. */
export function unmovedWords(channels: readonly string[], joints: readonly string[]): string {
  const [sent, known] = [channels, joints].map(
    (names) => names.slice(0, 3).map(isolated).join(', ') + (names.length > 3 ? ', …' : ''),
  );
  return more().unmoved(sent!, known!);
}

/** Says that meshes could not be loaded. `missing`: their URIs, of which at most four are named; `all`: how many meshes the model
 *  has, null if unknown. */
export function missingWords(missing: readonly string[], all: number | null): string {
  const names = missing.map((uri) => (uri.split('/').at(-1) ?? uri).replace(/\.[a-z]+$/i, ''));
  const shown = names.slice(0, 4).map(isolated).join(', ') + (names.length > 4 ? ', …' : '');
  return more().missing(missing.length, all, shown);
}

/** Says that only the skeleton of a body can be shown. `why`: the reason, from outside. */
function bareWords(why: string): string {
  return more().bare(isolated(why));
}

/** How many findings there are about the model. */
function remarksWords(count: number): string {
  return more().remarks(count);
}

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
        {report !== null && <Unmoved link={link} joints={report.joints} />}
        <BalanceLine link={link} />
      </div>
      {report !== null && <ModelFindings findings={report.findings} />}
    </>
  );
}

/** Names the joints that have no reading now and are shown at their last known position. */
function Unread({ link }: { link: RobotLink }) {
  const { schema } = link.twin;
  const lost = useMemo(() => (schema === null ? null : new LostReadings(schema)), [schema]);
  const joints = useTicked(500, () => {
    const { state } = link.twin;
    return state === null ? [] : (lost?.update(state.codes) ?? []);
  });
  return joints.length === 0 ? null : <p data-testid="unread-note">{unreadWords(joints)}</p>;
}

/** Says that the robot's readings and the joints of its model have different names. */
function Unmoved({ link, joints }: { link: RobotLink; joints: readonly string[] }) {
  const { schema } = link.twin;
  const channels = useMemo(() => (schema === null ? null : listUnmoving(schema, joints)), [schema, joints]);
  return channels === null ? null : <p data-testid="unmoved-note">{unmovedWords(channels, joints)}</p>;
}

function noteOf({ bare, missing }: ModelReport): string | null {
  if (bare !== undefined) return bareWords(bare);
  return missing.length > 0 ? missingWords(missing, null) : null;
}

/** A note that expands to what the edge's doctor found wrong with the model. Hints are left out, because only the model's author
 *  needs them. */
function ModelFindings({ findings = [] }: { findings: ModelReport['findings'] | undefined }) {
  const said = useMore();
  const shown = findings.filter(({ severity }) => severity !== 'hint');
  if (shown.length === 0) return null;
  return (
    <details className="model-findings" data-testid="model-findings">
      <summary>{remarksWords(shown.length)}</summary>
      <ul>
        {shown.map(({ severity, line, text }) => (
          <li key={`${line} ${text}`} data-severity={severity}>
            {isolated(text)}
            {line !== null && <span className="quiet"> · {said.line(line)}</span>}
          </li>
        ))}
      </ul>
    </details>
  );
}

/** A note that says why the body is not drawn in full 3D quality, with a button for the other renderer if that can help. */
export function ViewNote({
  trouble,
  choose,
}: {
  trouble: ViewTrouble;
  choose: (way: '3d' | 'light') => void;
}) {
  const text = useMore();
  return (
    <p data-testid="view-note" data-trouble={trouble} role="status">
      {viewWords(trouble)}
      {(trouble === 'given-up' || trouble === 'slow' || trouble === 'chosen') && (
        <button type="button" className="text-button" onClick={() => choose('3d')}>
          {trouble === 'chosen' ? text.backTo3d : text.try3d}
        </button>
      )}
      {(trouble === 'pixels' || trouble === 'detail') && (
        <button type="button" className="text-button" onClick={() => choose('light')}>
          {text.lightView}
        </button>
      )}
    </p>
  );
}
