import './present.css';
import { type ReactNode, useEffect, useSyncExternalStore } from 'react';
import { recordingUrl } from '../../relay/recording_address.ts';
import { home } from '../../relay/relay.ts';
import { nowMs } from '../../stream/clock.ts';
import { isolated } from '../../twin/names.ts';
import { BalanceLine } from '../balance/BalanceParts.tsx';
import { QrCode } from '../share/QrCode.tsx';
import { useNow } from '../shell/now.ts';
import { formatMoment, shownMoment, useShownSecond } from '../state/moment.ts';
import { present } from '../state/presenting.ts';
import { type RobotLink, useConnection, useIsOld, useVersion, useWord } from '../state/robot_link.ts';
import { robotHref } from '../state/route.ts';
import { Sign } from '../status/Chip.tsx';
import { chipWords, stageWords } from '../status/words.ts';
import { useMore } from '../text/more.ts';
import { usePresentText } from '../text/present.ts';
import { ChosenJoint } from './ChosenJoint.tsx';
import { Cross } from './Cross.tsx';
import { OpenFaultSentences } from './OpenFaultSentences.tsx';

/** What stands beside the robot while it is presented, legible from the last row: its state with its age, its balance, the joint that
 *  is looked at, its faults as sentences, and where everybody can see it. Escape or the cross ends presenting. `name`: of what
 *  is shown, ready to show (`isolated`); `note`: what somebody wrote about this moment. */
export function Presentation(props: { link: RobotLink; name: string; note?: ReactNode }) {
  const { link, name, note } = props;
  const text = usePresentText();
  useVersion(link);
  useZoom();
  useEffect(() => {
    const leave = (event: KeyboardEvent) => {
      if (event.key === 'Escape' && document.querySelector('dialog[open]') === null) present(false);
    };
    window.addEventListener('keydown', leave);
    return () => window.removeEventListener('keydown', leave);
  }, []);
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
  useNow(250);
  useWord(link); // so that a new word is shown at once
  useShownSecond(); // with the time line
  const connection = useConnection(link);
  const verdict = link.watch.verdict();
  const { word, detail, more, behind, warning } = chipWords(verdict, connection, nowMs());
  const why = stageWords(verdict, connection, nowMs());
  return (
    <>
      <p className="present-word" data-testid="present-word" data-state={verdict.word ?? ''}>
        <Sign word={verdict.word} />
        <b>{word}</b> {detail !== '' && <span>{detail}</span>} {behind !== '' && <span>{behind}</span>}
      </p>
      <p className="present-why">{why ?? more.replace(/^[ ·:]+/, '')}</p>
      {warning !== '' && <p className="present-warning">{warning}</p>}
    </>
  );
}

const OWN_COMPUTER = /^(localhost|127\.|\[::1\])/;

/** While the past plays its address stays so long the same, ms: a camera has to find it. */
const STILL_MS = 10_000;

/** The address of the robot's page as a QR code and in letters, without what is looked at now: it stays the same. In the
 *  past it leads to the moment. */
function Address({ link }: { link: RobotLink }) {
  const text = useMore();
  const shownMs = useSyncExternalStore(shownMoment.subscribe, () => {
    const momentMs = shownMoment.get();
    return momentMs === null || link.resting() ? momentMs : Math.floor(momentMs / STILL_MS) * STILL_MS;
  });
  const query = new URLSearchParams(window.location.search);
  query.delete('origin'); // of the page around a frame
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

/** The smallest letters of what the body has beside it (its legend, plots of a robot without a body), CSS px. */
const SMALLEST_PX = 11;
/** The least height of a letter's line, as a part of the picture's height. */
const LEAST_PART = 0.022;

/** Enlarges what is not written for the presentation until its smallest letters are large enough. */
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
