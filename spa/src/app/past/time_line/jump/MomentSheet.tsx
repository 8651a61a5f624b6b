import './jump.css';
import { useId, useState } from 'react';
import type { PastControls } from '../../../../past/past_types.ts';
import type { RobotTwin } from '../../../../twin/robot.ts';
import { Dialog } from '../../../shell/Dialog.tsx';
import { useMomentsText } from '../../../text/moments.ts';
import { Incidents } from '../incidents/Incidents.tsx';
import { DayList } from './DayList.tsx';
import { MomentForm } from './MomentForm.tsx';
import { momentSheet } from './moment_sheet.ts';

const WAYS = ['byTime', 'byFault'] as const;

/** The dialog for going to a moment: by day and time, or to one of the last faults. */
export function MomentSheet({ controls, twin }: { controls: PastControls; twin: RobotTwin }) {
  const text = useMomentsText();
  const name = useId();
  const [way, setWay] = useState<(typeof WAYS)[number]>('byTime');
  const close = () => momentSheet.set(null);
  const openAt = (momentMs: number) => {
    close();
    controls.openAt(momentMs);
  };
  const seek = (momentMs: number) => {
    close();
    controls.seek(momentMs);
  };
  return (
    <Dialog title={text.jump} testId="moment-sheet" onClose={close}>
      <fieldset className="choice moment-ways">
        <legend className="unseen">{text.jump}</legend>
        <div className="segments">
          {WAYS.map((each) => (
            <label key={each}>
              <input type="radio" name={name} checked={each === way} onChange={() => setWay(each)} />
              <span>{text[each]}</span>
            </label>
          ))}
        </div>
      </fieldset>
      {way === 'byTime' ? (
        <>
          <MomentForm controls={controls} onGo={openAt} />
          <DayList controls={controls} onGo={openAt} />
        </>
      ) : (
        <Incidents controls={controls} twin={twin} onGo={seek} />
      )}
      <button
        type="button"
        className="text-button moment-explain"
        aria-haspopup="dialog"
        data-explain="timeLine"
        onClick={close}
      >
        {text.explainLine}
      </button>
    </Dialog>
  );
}
