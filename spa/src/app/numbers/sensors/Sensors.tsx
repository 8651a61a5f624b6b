import './sensors.css';
import { useLayoutEffect, useRef } from 'react';
import { BalanceNumbers } from '../../balance/BalanceParts.tsx';
import { createElement } from '../../shell/cells.ts';
import { refreshWith } from '../../shell/refresh.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { onTraces } from '../../state/traces.ts';
import { onLanguage, say } from '../../text/language.ts';
import { SensorView } from './sensor_view.ts';

/** The element for the sensors, whose numbers are written directly to the DOM, without React, and below it the values that the
 *  page computes. */
export function Sensors({ link }: { link: RobotLink }) {
  const host = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    if (host.current === null) return;
    host.current.replaceChildren(createElement('p', 'note late', say().noNumbersYet));
    const view = new SensorView(host.current, link.twin, link.minute.readings);
    const write = () => view.write(link.nowMs());
    if (link.twin.state !== null) write(); // with the state word above, because entering the past changes all numbers at once
    const stop = refreshWith(link.twin, write, [onTraces, onLanguage]);
    return () => {
      stop();
      view.dispose();
    };
  }, [link]);
  return (
    <>
      <div className="numbers" ref={host} />
      <BalanceNumbers link={link} />
    </>
  );
}
