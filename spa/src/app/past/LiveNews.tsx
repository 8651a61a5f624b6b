import './live_news.css';
import { useEffect, useState } from 'react';
import type { PastControls } from '../../past/past_types.ts';
import { isolated } from '../../twin/names.ts';
import { useNow } from '../shell/now.ts';
import { useFaults } from '../state/fault_keeper.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { useMore } from '../text/more.ts';
import { usePastText } from '../text/past.ts';
import { faultSentence } from '../words/fault_sentence.ts';

/** Says that a new fault occurred while the past is shown, with a link to it. */
export function LiveNews({ live, controls }: { live: RobotLink; controls: PastControls }) {
  useNow(1000);
  useMore(); // loads the words of the sentence
  const text = usePastText();
  const [seen, setSeen] = useState<ReadonlySet<string> | null>(null);
  const faults = (useFaults(live.faults) ?? []).filter(
    ({ level, clearedMs }) => level === 'fault' && clearedMs === null,
  );
  useEffect(() => {
    if (seen === null) setSeen(new Set(faults.map(({ key }) => key)));
  }, [seen, faults]);
  const fresh = faults.find(({ key }) => seen !== null && !seen.has(key));
  if (fresh === undefined) return null;
  const { said } = faultSentence(live.twin, live.faults.log, fresh, live.faults.nowMs());
  return (
    <p className="past-news" role="alert" data-testid="past-news">
      <span>{text.now(isolated(said))}</span>
      <button type="button" className="text-button" onClick={() => controls.goLive()}>
        {text.live}
      </button>
    </p>
  );
}
