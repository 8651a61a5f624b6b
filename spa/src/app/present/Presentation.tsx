import './present.css';
import { type ReactNode, useEffect, useSyncExternalStore } from 'react';
import { home, recordingUrl } from '../../relay/relay.ts';
import { nowMs } from '../../stream/clock.ts';
import { type AngleUnit, displayOf, formatNumber } from '../../twin/format.ts';
import { NUMBERS } from '../../twin/joints.ts';
import { isThen } from '../../twin/liveness.ts';
import { isolated, plainName } from '../../twin/names.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { BalanceLine } from '../balance/BalanceParts.tsx';
import { Sign } from '../robot/Chip.tsx';
import { QrCode } from '../share/QrCode.tsx';
import { usePageKeys } from '../shell/page_keys.ts';
import { formatMoment, robotHref } from '../state/address.ts';
import { useFaults } from '../state/fault_keeper.ts';
import { useTicked } from '../state/hooks.ts';
import { type RobotLink, useConnection, useIsOld, useVersion, useWord } from '../state/robot_link.ts';
import { useSettings } from '../state/settings.ts';
import { present, selectJoint, shownMoment, useSelectedJoint, useShownSecond } from '../state/viewing.ts';
import { languageTag, useMore } from '../text/language.ts';
import { faultSentence } from '../words/fault_sentence.ts';
import { saysMore } from '../words/moment.ts';
import { chipWords, stageWords } from '../words/status.ts';

const MOST = 3;

/** The unacknowledged faults, each as a sentence; if there are many, the first ones and the number of the others. */
function OpenFaultSentences({ link }: { link: RobotLink }) {
  const text = useMore();
  const open = (useFaults(link.faults) ?? []).filter(({ acknowledged }) => !acknowledged);
  const sentences = useTicked(500, () =>
    open.slice(0, MOST).map((fault) => faultSentence(link.twin, link.faults.log, fault, link.faults.nowMs())),
  );
  return (
    <ul className="present-faults" data-testid="present-faults">
      {open.slice(0, MOST).map((fault, i) => {
        const { said, code } = sentences[i]!;
        const isOver = fault.clearedMs !== null;
        return (
          <li key={fault.key}>
            <i className="present-mark" data-level={fault.level} data-over={isOver} />
            <span>
              {said}{' '}
              <small className="quiet">{[code, isOver ? text.ended : ''].filter(Boolean).join(' · ')}</small>
            </span>
          </li>
        );
      })}
      {open.length > MOST && <li className="quiet">{text.moreFaults(open.length - MOST)}</li>}
    </ul>
  );
}

/** The position is above the others. */
const PRESENTED = NUMBERS.filter((row) => 'presented' in row);
/** Numbers that change faster can't be read. */
const EVERY_MS = 250;

/** The selected joint, large: its name, its position and its other readings. Empty if none is selected. */
function ChosenJoint({ link }: { link: RobotLink }) {
  const joint = useSelectedJoint();
  const { angle } = useSettings();
  const text = useMore();
  const { twin } = link;
  const readings = useTicked(EVERY_MS, () =>
    joint === null
      ? []
      : PRESENTED.map(({ name, presented }) => ({
          ...{ name, presented, value: readingWords(twin, name, joint, angle) },
        })),
  );
  if (joint === null) return null;
  const plain = plainName(twin.schema, joint, languageTag());
  return (
    <section className="present-joint" aria-label={isolated(joint)} data-testid="present-joint">
      <h3>
        {isolated(joint)} {plain !== undefined && <span>{plain}</span>}
        <Cross what={text.closeCard} onPress={() => selectJoint(null)} />
      </h3>
      <p className="present-value">{readings.find(({ presented }) => presented === 'first')?.value}</p>
      <dl>
        {readings.map(
          ({ name, presented, value }) =>
            presented === 'also' &&
            value !== null && (
              <div key={name}>
                <dt>{text[`${name}Name`]}</dt>
                <dd>{value}</dd>
              </div>
            ),
        )}
      </dl>
    </section>
  );
}

/** Shown beside the robot while presenting, legible from the last row: its state and age, its balance, the selected joint, its
 *  faults as sentences, and the address for the audience. Escape or the cross ends presenting. `name`: of what is shown, safe to
 *  show (`isolated`); `note`: the note about this moment. */
export function Presentation(props: { link: RobotLink; name: string; note?: ReactNode }) {
  const { link, name, note } = props;
  const text = useMore();
  useVersion(link);
  useZoom();
  usePageKeys(() => ({ close: () => present(false) }));
  return (
    <div className="presentation" data-old={useIsOld(link)} data-testid="presentation">
      <div className="present-left">
        <div className="present-head">
          <h2 className="present-name" title={name}>
            {name}
          </h2>
          <Cross what={text.leavePresenting} onPress={() => present(false)} />
        </div>
        <State link={link} />
        <BalanceLine link={link} className="present-balance" />
        <ChosenJoint link={link} />
      </div>
      <OpenFaultSentences link={link} />
      <div className="present-right">
        {note}
        <Address link={link} />
      </div>
    </div>
  );
}

/** The word of the chip, large, with its age and, if the robot is not live, why. */
function State({ link }: { link: RobotLink }) {
  useWord(link); // shows a new state word at once
  useShownSecond(); // redraws as the time line moves
  const connection = useConnection(link);
  const verdict = link.watch.verdict();
  const { word, detail, more, behind, warning, why } = useTicked(250, () => {
    const verdict = link.watch.verdict();
    // the date is in the first line already
    const isSaid = isThen(verdict.word) && !saysMore(verdict);
    const why = isSaid ? null : stageWords(verdict, connection, nowMs());
    return { ...chipWords(verdict, connection, nowMs()), why };
  });
  return (
    <>
      <p className="present-word" data-testid="present-word" data-state={verdict.word ?? ''}>
        <b>
          <Sign word={verdict.word} />
          {word}
        </b>{' '}
        {detail !== '' && <span>{detail}</span>} {behind !== '' && <span>{behind}</span>}
      </p>
      <p className="present-why">{why ?? more.replace(/^[ ·:]+/, '')}</p>
      {warning !== '' && <p className="present-warning">{warning}</p>}
    </>
  );
}

const OWN_COMPUTER = /^(localhost|127\.|\[::1\])/;

/** While the past plays, its address stays the same for this long, ms, so that a camera can read it. */
const STILL_MS = 10_000;

/** The address of the robot's page as a QR code and in letters, without the current view, so that it stays the same. In the past
 *  it leads to the moment. */
function Address({ link }: { link: RobotLink }) {
  const text = useMore();
  const shownMs = useSyncExternalStore(shownMoment.subscribe, () => {
    const momentMs = shownMoment.get();
    return momentMs === null || link.resting() ? momentMs : Math.floor(momentMs / STILL_MS) * STILL_MS;
  });
  const query = new URLSearchParams(window.location.search);
  query.delete('origin'); // the page around a frame
  query.delete('gestures'); // of a finger on this page
  query.delete('lane'); // how this page reads the robot, not what it shows
  const place = recordingUrl() === null ? robotHref(link.twin.robot) : '#/';
  const address = `${home()}${query.size > 0 ? `?${query}` : ''}${place}${
    shownMs === null ? '' : `?t=${formatMoment(shownMs)}`
  }`;
  const { hostname } = new URL(address);
  return (
    <div className="present-address" data-testid="present-address">
      <QrCode text={address} className="present-code" />
      <p>{isolated(address.replace(/^https?:\/\//, ''))}</p>
      {OWN_COMPUTER.test(hostname) && <p className="present-warning">{text.onlyThisComputer(hostname)}</p>}
    </div>
  );
}

/** The smallest letters beside the body (the legend, or plots of a robot without a body), CSS px. */
const SMALLEST_PX = 11;
/** The minimum line height, as a fraction of the picture's height. */
const LEAST_PART = 0.022;

/** Enlarges elements not made for presenting until their smallest letters are large enough. */
function useZoom(): void {
  useEffect(() => {
    const { style } = document.documentElement;
    const enlarge = () =>
      style.setProperty('--zoom', String(Math.max(1, (LEAST_PART * window.innerHeight) / SMALLEST_PX)));
    enlarge();
    window.addEventListener('resize', enlarge);
    return () => {
      window.removeEventListener('resize', enlarge);
      style.removeProperty('--zoom');
    };
  }, []);
}

/** A cross that ends or closes something while presenting. `what`: its label. */
function Cross({ what, onPress }: { what: string; onPress: () => void }) {
  return (
    <button type="button" className="present-cross" title={what} aria-label={what} onClick={onPress}>
      ×
    </button>
  );
}

/** A joint's newest value with its unit, "1.332 rad"; null if the robot does not report it. */
function readingWords(twin: RobotTwin, field: string, joint: string, angle: AngleUnit): string | null {
  const reported = twin.schema?.field(field);
  if (reported == null || !reported.labels.includes(joint)) return null;
  const unit = twin.schema?.mapping.unit(field, joint) ?? reported.unit;
  const display = displayOf(unit, angle, reported.scale);
  return `${formatNumber(twin.value(field, joint) ?? null, display).trim()} ${display.unit}`;
}
