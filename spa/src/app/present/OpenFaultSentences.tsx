import { formatSpan } from '../../twin/format.ts';
import { isolated, plainName } from '../../twin/names.ts';
import { useNow } from '../shell/now.ts';
import { useFaults } from '../state/fault_keeper.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { useSettings } from '../state/settings.ts';
import { faultWords } from '../status/fault_words.ts';
import { usePresentText } from '../text/present.ts';
import { deviationWords } from './reading_words.ts';

const MOST = 3;

/** The faults that nobody has acknowledged, each as a sentence; of many the first, and how many more there are. */
export function OpenFaultSentences({ link }: { link: RobotLink }) {
  useNow(500); // how long they have lasted
  const text = usePresentText();
  const { angle } = useSettings();
  const open = (useFaults(link.faults) ?? []).filter(({ acknowledged }) => !acknowledged);
  return (
    <ul className="present-faults" data-testid="present-faults">
      {open.slice(0, MOST).map((fault) => {
        const name = isolated(fault.source);
        const plain = plainName(link.twin.schema, fault.source);
        const who = plain === undefined ? name : `${plain[0]?.toUpperCase()}${plain.slice(1)} (${name})`;
        const off = fault.what === 'apart' ? deviationWords(link.twin, fault.source, angle) : '';
        const what = faultWords(fault, off);
        const lastsMs = Math.floor(Math.max(0, Date.now() - fault.firstMs) / 1000) * 1000;
        return (
          <li key={fault.key}>
            <i className="present-mark" data-level={fault.level} data-over={fault.clearedMs !== null} />
            <span>
              {fault.clearedMs === null
                ? text.faultFor(who, what, formatSpan(lastsMs))
                : text.faultOver(who, what)}
            </span>
          </li>
        );
      })}
      {open.length > MOST && <li className="quiet">{text.moreFaults(open.length - MOST)}</li>}
    </ul>
  );
}
