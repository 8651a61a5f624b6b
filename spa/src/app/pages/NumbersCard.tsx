import { useEffect, useRef, useState } from 'react';
import { displayOf, formatNumber } from '../../twin/format.ts';
import { isolated } from '../../twin/names.ts';
import { arrangeTraces } from '../../twin/plots/choice.ts';
import { type TraceReading, traceReading } from '../../twin/plots/trace.ts';
import { OpenFaults } from '../numbers/alarms/Alarms.tsx';
import { Chip } from '../robot/Chip.tsx';
import { refreshWith } from '../shell/refresh.ts';
import { robotHref } from '../state/address.ts';
import { useFaults } from '../state/fault_keeper.ts';
import { type RobotLink, useVersion, useWord } from '../state/robot_link.ts';
import { useSettings } from '../state/settings.ts';
import { useMore } from '../text/language.ts';

const MOST_VALUES = 12;
const MOST_FAULTS = 4;
/** After this long the values are chosen once more: by then the history shows which of them move. */
const CHOSEN_AGAIN_MS = 4000;

/** The card of a robot without a body, in a row of robots: its name, state, open faults, and the values that move most. `why`:
 *  why there is no body; null for a robot without a model. */
export function NumbersCard({ link, why }: { link: RobotLink; why: string | null }) {
  useVersion(link);
  const rest = useMore();
  const word = useWord(link);
  const { angle } = useSettings();
  const body = useRef<HTMLTableSectionElement>(null);
  const readings = useReadings(link);
  const open = useFaults(link.faults) ?? [];

  useEffect(() => {
    const write = () => {
      const { state } = link.twin;
      for (const [i, { unit, scale, read }] of readings.entries()) {
        const [, value] = body.current?.rows[i]?.cells ?? [];
        if (value === undefined) continue;
        const display = displayOf(unit, angle, scale);
        value.textContent = `${formatNumber(state === null ? null : read(state.codes), display)} ${display.unit}`;
      }
    };
    return refreshWith(link.twin, write);
  }, [link, readings, angle]);

  const { robot, schema } = link.twin;
  return (
    <section
      className="row-card"
      data-testid={`numbers-${robot}`}
      data-state={word ?? ''}
      aria-label={link.twin.name}
    >
      <header>
        <a href={robotHref(robot)} className="line-name">
          {link.twin.name}
        </a>
        <Chip link={link} />
      </header>
      {schema !== null && <p className="quiet">{why === null ? rest.noModel : rest.noBody(isolated(why))}</p>}
      <OpenFaults link={link} faults={open.slice(0, MOST_FAULTS)} />
      <table>
        <tbody ref={body}>
          {readings.map(({ title }) => (
            <tr key={title}>
              <th scope="row">{title}</th>
              <td />
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

/** Reads the robot's values that moved most; the choice is kept until the schema changes. */
function useReadings(link: RobotLink): readonly TraceReading[] {
  const { schema } = link.twin;
  const { history } = link.minute;
  const [readings, setReadings] = useState<readonly TraceReading[]>([]);
  useEffect(() => {
    if (schema === null) return;
    const choose = () => {
      const traces = arrangeTraces(history, link.nowMs()).slice(0, MOST_VALUES);
      setReadings(traces.flatMap((trace) => traceReading(schema, trace) ?? []));
    };
    choose();
    const again = setTimeout(choose, CHOSEN_AGAIN_MS);
    return () => clearTimeout(again);
  }, [history, schema, link]);
  return readings;
}
