import { useNow } from '../shell/now.ts';
import { useFaults } from '../state/fault_keeper.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { useMore } from '../text/more.ts';
import { usePresentText } from '../text/present.ts';
import { faultSentence } from '../words/fault_sentence.ts';

const MOST = 3;

/** The unacknowledged faults, each as a sentence; if there are many, the first ones and the number of the others. */
export function OpenFaultSentences({ link }: { link: RobotLink }) {
  useNow(500); // updates how long they have lasted
  useMore(); // loads the words of the sentences
  const text = usePresentText();
  const open = (useFaults(link.faults) ?? []).filter(({ acknowledged }) => !acknowledged);
  return (
    <ul className="present-faults" data-testid="present-faults">
      {open.slice(0, MOST).map((fault) => {
        const { said, code } = faultSentence(link.twin, link.faults.log, fault, link.faults.nowMs());
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
