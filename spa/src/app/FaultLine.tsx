import { useEffect, useState } from 'react';
import { nowMs } from '../stream/clock.ts';
import { type ActiveFault, FaultWatch } from '../twin/faults.ts';
import { formatSpan } from '../twin/format.ts';
import { JointTable } from '../twin/joints.ts';
import type { RobotLink } from './robot_link.ts';

const EVERY_MS = 500;

/** What is wrong now, in one line: it stands above the tabs, and is what a phone shows when the sheet is down. */
export function FaultLine({ link }: { link: RobotLink }) {
  const faults = useFaults(link);
  const first = faults?.[0];
  return (
    <div className="fault-line" data-testid="fault-line" data-faults={faults?.length}>
      {first === undefined ? (
        <span className="quiet">{faults === null ? '' : 'No faults'}</span>
      ) : (
        <>
          <span className="fault-mark" aria-hidden="true" />
          <b>{first.label}</b>
          <span className="fault-words" title={first.plain ?? undefined}>
            {first.words}
          </span>
          <span className="quiet">· {sinceWords(nowMs() - first.sinceMs)}</span>
          {faults !== null && faults.length > 1 && <span className="quiet more">+{faults.length - 1}</span>}
        </>
      )}
    </div>
  );
}

function sinceWords(spanMs: number): string {
  return spanMs < 1000 ? 'now' : formatSpan(Math.floor(spanMs / 1000) * 1000);
}

/** null until a pose has come: no news of faults is not "no faults". */
function useFaults({ twin }: RobotLink): readonly ActiveFault[] | null {
  const [faults, setFaults] = useState<readonly ActiveFault[] | null>(null);
  useEffect(() => {
    const watch = new FaultWatch();
    let table: JointTable | null = null;
    let schemaId: number | null = null;
    const look = () => {
      const { schema, state } = twin;
      if (schema === null || state === null) return;
      if (table === null || schemaId !== schema.id) {
        table = new JointTable(schema);
        schemaId = schema.id;
      }
      const found = watch.update(table.read(state.codes), nowMs());
      setFaults((before) => (found.length === 0 && before?.length === 0 ? before : found));
    };
    look();
    const timer = setInterval(look, EVERY_MS);
    return () => clearInterval(timer);
  }, [twin]);
  return faults;
}
