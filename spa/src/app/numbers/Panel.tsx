import { type KeyboardEvent, useEffect, useLayoutEffect, useRef, useSyncExternalStore } from 'react';
import { createElement } from '../shell/cells.ts';
import { late } from '../shell/late.tsx';
import { refreshWith } from '../shell/refresh.ts';
import { ROOM_FOR_BOTH, useMedia } from '../shell/theme.ts';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { changeSettings, useSettings } from '../state/settings.ts';
import { onSelection, selection, useSelectedJoint, useTraces } from '../state/viewing.ts';
import { onLanguage, say, useMore, useText } from '../text/language.ts';
import { FaultLine } from './alarms/FaultLine.tsx';
import { filterText, JointView, onFilter, setFilter, type TableSources } from './table/joint_view.ts';
import { carryValues } from './value_drag.ts';
import './numbers.css';
import './table/joints.css';

// The table is loaded at once, the other tabs when they are opened.
const JointCard = late(async () => (await import('./table/JointCard.tsx')).JointCard);
const Sensors = late(async () => (await import('./sensors/Sensors.tsx')).Sensors);
const Plots = late(async () => (await import('./plots/Plots.tsx')).Plots);
const Alarms = late(async () => (await import('./alarms/Alarms.tsx')).Alarms);

const TABS = ['Joints', 'Sensors', 'Plots', 'Alarms'] as const;
export type Tab = (typeof TABS)[number];

/** The panel of numbers: faults and four tabs. If the robot has no joints, their tab is absent and sensors come first. The open
 *  tab is kept outside, because turning a phone replaces the panel. */
export function Panel({
  link,
  tab: chosen,
  onTab: setTab,
}: {
  link: RobotLink;
  tab: Tab;
  onTab: (tab: Tab) => void;
}) {
  const text = useText();
  const panel = useRef<HTMLDivElement>(null);
  const tabs = useRef<HTMLDivElement>(null);
  const joint = useSelectedJoint();
  const traces = useTraces().length;
  useVersion(link);
  const tabsOfRobot = link.twin.joints()?.rows.length === 0 ? TABS.slice(1) : TABS;
  const tab = tabsOfRobot.includes(chosen) ? chosen : tabsOfRobot[0]!;
  useEffect(() => {
    // Follows a selection made anywhere. Not on mount: a phone that is turned keeps its tab.
    return onSelection(() => selection() !== null && setTab('Joints'));
  }, [setTab]);
  useEffect(() => {
    if (panel.current !== null) return carryValues(panel.current, () => setTab('Plots'));
  }, [setTab]);

  const onKeyDown = (event: KeyboardEvent) => {
    const step = event.key === 'ArrowRight' ? 1 : event.key === 'ArrowLeft' ? -1 : 0;
    if (step === 0) return;
    const next = (tabsOfRobot.indexOf(tab) + step + tabsOfRobot.length) % tabsOfRobot.length;
    setTab(tabsOfRobot[next] ?? tab);
    tabs.current?.querySelectorAll('button')[next]?.focus();
  };

  return (
    <div className="panel" ref={panel}>
      <FaultLine link={link} onMore={() => setTab('Alarms')} />
      <div className="tabs" role="tablist" aria-label={text.numbers} ref={tabs} onKeyDown={onKeyDown}>
        {tabsOfRobot.map((name) => (
          <button
            key={name}
            type="button"
            role="tab"
            id={`tab-${name}`}
            aria-selected={tab === name}
            aria-controls={`panel-${name}`}
            tabIndex={tab === name ? 0 : -1}
            onClick={() => setTab(name)}
          >
            {text[name.toLowerCase() as Lowercase<Tab>]}
            {name === 'Plots' && traces > 0 && <small className="tab-count">{traces}</small>}
          </button>
        ))}
      </div>
      <div className="tab-body" role="tabpanel" id={`panel-${tab}`} aria-labelledby={`tab-${tab}`} key={tab}>
        {tab === 'Joints' && <Joints link={link} joint={joint} />}
        {tab === 'Sensors' && <Sensors link={link} />}
        {tab === 'Plots' && <Plots link={link} />}
        {tab === 'Alarms' && <Alarms link={link} />}
      </div>
    </div>
  );
}

/** The joint table and below it the card of the selected joint, which replaces the table if space is short. */
function Joints({ link, joint }: { link: RobotLink; joint: string | null }) {
  const both = useMedia(ROOM_FOR_BOTH);
  return (
    <div className="joints-room">
      {(joint === null || both) && (
        <>
          <div className="table-tools">
            <TableTools />
          </div>
          <div className="table-room">
            <JointNumbers link={link} />
          </div>
        </>
      )}
      {joint !== null && <JointCard link={link} joint={joint} />}
    </div>
  );
}

/** The element for the joint table, whose numbers are written directly to the DOM, without React. */
function JointNumbers({ link }: { link: RobotLink }) {
  const host = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    if (host.current === null) return;
    host.current.replaceChildren(createElement('p', 'note late', say().noNumbersYet));
    const sources: TableSources = {
      get faults() {
        return link.faults.log;
      },
      readings: link.minute.readings,
      nowMs: link.nowMs,
    };
    const view = new JointView(host.current, link.twin, sources);
    const write = () => view.write(link.nowMs());
    if (link.twin.state !== null) write(); // with the state word above, because entering the past changes all numbers at once
    const stop = refreshWith(link.twin, write, [link.faults.onChange, onLanguage]);
    return () => {
      stop();
      view.dispose();
    };
  }, [link]);
  return <div className="numbers" ref={host} />;
}

/** The tools of the joint table: filter, sort order and unit. */
function TableTools() {
  const filter = useSyncExternalStore(onFilter, filterText);
  const { limbs, angle } = useSettings();
  const text = useMore();
  const [now, other] = angle === 'rad' ? [text.inRadians, text.inDegrees] : [text.inDegrees, text.inRadians];
  return (
    <>
      <input
        type="search"
        className="filter"
        data-testid="filter"
        placeholder={text.filter}
        aria-label={text.filterJoints}
        value={filter}
        onChange={(event) => setFilter(event.target.value)}
        onKeyDown={(event) => event.key === 'Escape' && setFilter('')}
      />
      <button
        type="button"
        className="tool"
        aria-pressed={limbs}
        data-testid="limbs"
        title={text.limbByLimb}
        onClick={() => changeSettings({ limbs: !limbs })}
      >
        {text.limbs}
      </button>
      <button
        type="button"
        className="tool"
        data-testid="angle"
        aria-label={`${angle}: ${text.changeIt(now)}`}
        title={other}
        onClick={() => changeSettings({ angle: angle === 'rad' ? 'deg' : 'rad' })}
      >
        {angle}
      </button>
    </>
  );
}
