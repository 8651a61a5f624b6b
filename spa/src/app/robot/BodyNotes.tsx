import '../shell/styles/tools.css';
import { useMemo } from 'react';
import type { ModelReport } from '../../model/report.ts';
import { listUnmoving } from '../../twin/kinematic_tree.ts';
import { isolated } from '../../twin/names.ts';
import { LostReadings } from '../../twin/sensors/last_readings.ts';
import { BalanceLine } from '../balance/BalanceParts.tsx';
import { Tucked } from '../shell/Tucked.tsx';
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

/** Notices about the picture: joints without a reading, a body that no reading moves, meshes that are missing, how it is drawn, what the edge's doctor found wrong
 *  with the model. Together one button that opens them. Beside it, the robot's balance. */
export function BodyNotes(props: {
  link: RobotLink;
  trouble: ViewTrouble | null;
  /** The report of the shown model; null while there is none. */
  report: ModelReport | null;
  choose: (way: '3d' | 'light') => void;
}) {
  const { link, trouble, report, choose } = props;
  const doubts = [
    { key: 'unread-note', words: useUnread(link) },
    { key: 'unmoved-note', words: useUnmoved(link, report?.joints) },
    { key: 'model-note', words: report === null ? '' : noteOf(report) },
  ].filter(({ words }) => words !== '');
  return (
    <div className="stage-views">
      <BalanceLine link={link} tucked />
      <Notices {...{ doubts, trouble, choose }} findings={report?.findings} />
    </div>
  );
}

/** The button that opens the notices; empty if there are none. */
export function Notices(props: {
  /** Why the body may not look as the robot does. */
  doubts?: readonly { readonly key: string; readonly words: string }[];
  trouble: ViewTrouble | null;
  choose: (way: '3d' | 'light') => void;
  findings?: ModelReport['findings'] | undefined;
}) {
  const { doubts = [], trouble, choose, findings = [] } = props;
  const text = useMore();
  const remarks = findings.filter(({ severity }) => severity !== 'hint'); // only the model's author needs hints
  const words = [
    ...doubts.map((doubt) => doubt.words),
    ...(trouble === null ? [] : [viewWords(trouble)]),
    ...(remarks.length === 0 ? [] : [text.remarks(remarks.length)]),
  ];
  if (words.length === 0) return null;
  return (
    <>
      <Tucked
        always
        className="notices"
        brief={
          <>
            <i
              className="notice-mark"
              data-level={doubts.length > 0 ? 'caution' : 'note'}
              aria-hidden="true"
            />
            <span className="notice-first">{words[0]}</span>
            {words.length > 1 && <span className="notice-first">+{words.length - 1}</span>}
            <span className="notice-count">{text.notices(words.length)}</span>
          </>
        }
      >
        {doubts.map((doubt) => (
          <p key={doubt.key} data-testid={doubt.key}>
            {doubt.words}
          </p>
        ))}
        {trouble !== null && <ViewNote {...{ trouble, choose }} />}
        {remarks.length > 0 && (
          <section data-testid="model-findings">
            <p>{text.remarks(remarks.length)}</p>
            <ul>
              {remarks.map(({ severity, line, text: found }) => (
                <li key={`${line} ${found}`} data-severity={severity}>
                  {isolated(found)}
                  {line !== null && <span className="quiet"> · {text.line(line)}</span>}
                </li>
              ))}
            </ul>
          </section>
        )}
      </Tucked>
      {trouble !== null && (
        <p className="unseen" role="status">
          {viewWords(trouble)}
        </p>
      )}
    </>
  );
}

/** Names the joints that have no reading now and are shown at their last known position; '' if there are none. */
function useUnread(link: RobotLink): string {
  const { schema } = link.twin;
  const lost = useMemo(() => (schema === null ? null : new LostReadings(schema)), [schema]);
  const joints = useTicked(500, () => {
    const { state } = link.twin;
    return state === null ? [] : (lost?.update(state.codes) ?? []);
  });
  return joints.length === 0 ? '' : unreadWords(joints);
}

/** Says that the robot's readings and the joints of its model have different names; '' if they have not. */
function useUnmoved(link: RobotLink, joints: readonly string[] | undefined): string {
  const { schema } = link.twin;
  const channels = useMemo(
    () => (schema === null || joints === undefined ? null : listUnmoving(schema, joints)),
    [schema, joints],
  );
  return channels === null ? '' : unmovedWords(channels, joints ?? []);
}

function noteOf({ bare, missing }: ModelReport): string {
  if (bare !== undefined) return bareWords(bare);
  return missing.length > 0 ? missingWords(missing, null) : '';
}

/** A note that says why the body is not drawn in full 3D quality, with a button for the other renderer if that can help. */
function ViewNote({ trouble, choose }: { trouble: ViewTrouble; choose: (way: '3d' | 'light') => void }) {
  const text = useMore();
  return (
    <p data-testid="view-note" data-trouble={trouble}>
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
