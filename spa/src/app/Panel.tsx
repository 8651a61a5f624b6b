import { type KeyboardEvent, useEffect, useRef, useState } from 'react';
import { nowMs } from '../stream/clock.ts';
import { Alarms } from './Alarms.tsx';
import { FaultLine } from './FaultLine.tsx';
import type { RobotLink } from './robot_link.ts';
import { make } from './table/cells.ts';
import { JointView } from './table/joint_view.ts';
import { refreshWith } from './table/refresh.ts';
import { SensorView } from './table/sensor_view.ts';

const TABS = ['Joints', 'Sensors', 'Alarms'] as const;
type Tab = (typeof TABS)[number];

/** The numbers: what is wrong now, and three tabs. */
export function Panel({ link }: { link: RobotLink }) {
  const [tab, setTab] = useState<Tab>('Joints');
  const tabs = useRef<HTMLDivElement>(null);

  const onKeyDown = (event: KeyboardEvent) => {
    const step = event.key === 'ArrowRight' ? 1 : event.key === 'ArrowLeft' ? -1 : 0;
    if (step === 0) return;
    const next = (TABS.indexOf(tab) + step + TABS.length) % TABS.length;
    setTab(TABS[next] ?? tab);
    tabs.current?.querySelectorAll('button')[next]?.focus();
  };

  return (
    <div className="panel">
      <FaultLine link={link} />
      <div className="tabs" role="tablist" aria-label="Numbers" ref={tabs} onKeyDown={onKeyDown}>
        {TABS.map((name) => (
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
            {name}
          </button>
        ))}
      </div>
      <div className="tab-body" role="tabpanel" id={`panel-${tab}`} aria-labelledby={`tab-${tab}`} key={tab}>
        {tab === 'Joints' && <Numbers link={link} kind="joints" />}
        {tab === 'Sensors' && <Numbers link={link} kind="sensors" />}
        {tab === 'Alarms' && <Alarms link={link} />}
      </div>
    </div>
  );
}

/** Only the place for them: the numbers themselves are written past React. */
function Numbers({ link, kind }: { link: RobotLink; kind: 'joints' | 'sensors' }) {
  const host = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (host.current === null) return;
    host.current.replaceChildren(make('p', 'note late', 'No numbers yet.'));
    const view =
      kind === 'joints' ? new JointView(host.current, link.twin) : new SensorView(host.current, link.twin);
    const stop = refreshWith(link.twin, () => view.write(nowMs()));
    return () => {
      stop();
      view.dispose();
    };
  }, [link, kind]);
  return <div className="numbers" ref={host} />;
}
