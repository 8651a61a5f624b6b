import { useId } from 'react';
import { nowMs } from '../../stream/clock.ts';
import { late } from '../shell/late.tsx';
import { usePopover } from '../shell/page_keys.ts';
import { useTicked } from '../state/hooks.ts';
import { type RobotLink, useConnection, useWord } from '../state/robot_link.ts';
import { useShownSecond } from '../state/viewing.ts';
import { useText } from '../text/language.ts';
import { chipWords } from '../words/status.ts';

const Explanation = late(async () => (await import('./Explanation.tsx')).Explanation);

/** A button with the robot's state: LIVE, HOLDING, STALE, OFFLINE, PAST or RECORDED, with its frame rate or age. Pressing it opens an
 *  explanation. */
export function Chip({ link }: { link: RobotLink }) {
  useWord(link); // shows a new state word at once
  useShownSecond(); // redraws as the time line moves
  const connection = useConnection(link);
  useText();
  const { open, setOpen, around } = usePopover<HTMLDivElement>();
  const explanation = useId();

  const verdict = link.watch.verdict();
  const { word, detail, more, behind, warning } = useTicked(250, () =>
    chipWords(link.watch.verdict(), connection, nowMs()),
  );
  return (
    <div className="chip-around" ref={around}>
      <button
        type="button"
        className="chip"
        data-testid="liveness"
        data-state={verdict.word ?? ''}
        data-cause={verdict.cause ?? ''}
        aria-expanded={open}
        aria-controls={explanation}
        onClick={() => setOpen(!open)}
      >
        <Sign word={verdict.word} />
        <b>{word}</b>
        {detail + more !== '' && (
          <span className="chip-detail">
            {detail}
            <span className="chip-more">{more}</span>
          </span>
        )}
        {behind !== '' && (
          <span className="chip-behind" data-testid="behind">
            {behind}
          </span>
        )}
        {warning !== '' && <span className="chip-warning">{warning}</span>}
      </button>
      {open && (
        <div className="popover" id={explanation} data-testid="liveness-explained">
          <Explanation link={link} />
        </div>
      )}
    </div>
  );
}

/** The symbol of a state, so that colour is not the only cue. `word`: LIVE, HOLDING, STALE, OFFLINE, PAST or RECORDED; null while
 *  the page connects. */
export function Sign({ word }: { word: string | null }) {
  return (
    <svg className="sign" viewBox="0 0 16 16" aria-hidden="true">
      {word === 'LIVE' && <circle cx="8" cy="8" r="5" fill="currentColor" />}
      {word === 'HOLDING' && (
        <circle cx="8" cy="8" r="4.2" fill="none" stroke="currentColor" strokeWidth="2.2" />
      )}
      {word === 'STALE' && (
        <g fill="none" stroke="currentColor" strokeWidth="1.7" strokeLinecap="round">
          <circle cx="8" cy="8" r="5.6" />
          <path d="M8 4.9V8l2.2 1.6" />
        </g>
      )}
      {word === 'OFFLINE' && (
        <g fill="none" stroke="currentColor" strokeWidth="1.8" strokeLinecap="round">
          <circle cx="8" cy="8" r="5.2" />
          <path d="M4.4 11.6l7.2-7.2" />
        </g>
      )}
      {word === 'PAST' && (
        <g fill="none" stroke="currentColor" strokeWidth="1.7" strokeLinecap="round" strokeLinejoin="round">
          <path d="M3.1 5.2a5.6 5.6 0 1 1-.7 2.9" />
          <path d="M2.6 2.4v3.2h3.2" />
        </g>
      )}
      {word === 'RECORDED' && (
        <path
          d="M2.5 3.2h11v9.6h-11zM6.7 5.7v4.6l3.8-2.3z"
          fill="none"
          stroke="currentColor"
          strokeWidth="1.7"
          strokeLinejoin="round"
        />
      )}
      {word === null && (
        <circle
          cx="8"
          cy="8"
          r="4.6"
          fill="none"
          stroke="currentColor"
          strokeWidth="1.6"
          strokeDasharray="2.4 2.4"
        />
      )}
    </svg>
  );
}
