import { laneUrl } from '../../relay/lane.ts';
import { isClaim } from '../../twin/liveness.ts';
import { useCatalogue } from '../explain/catalogue.ts';
import { type RobotLink, useConnection } from '../state/robot_link.ts';
import { useMore } from '../text/more.ts';
import { explanationWords } from '../words/explanation_words.ts';

/** The explanation that the chip opens: the reason for the state, and what to do about a lowered rate. */
export function Explanation({ link }: { link: RobotLink }) {
  const connection = useConnection(link);
  const text = useMore();
  const catalogue = useCatalogue();
  const verdict = link.watch.verdict();
  const isBehind = connection.behindMs !== null && isClaim(verdict.word);
  const told = catalogue?.words[isBehind ? 'BEHIND' : (verdict.word ?? '')];
  const isLaneChosen = laneUrl(link.twin.robot) !== null;
  return (
    <>
      {explanationWords(verdict, connection, isLaneChosen).map((line, i) => (
        <p key={i === 0 ? 'first' : line.split(':')[0]}>{line}</p>
      ))}
      {told !== undefined && (
        <p>
          {told.what} {told.how}
        </p>
      )}
      {connection.rateReason !== null && connection.phase === 'open' && (
        <button
          type="button"
          className="text-button"
          data-testid="wish-all"
          onClick={() => link.client.wishAll()}
        >
          {text.askAll}
        </button>
      )}
    </>
  );
}
