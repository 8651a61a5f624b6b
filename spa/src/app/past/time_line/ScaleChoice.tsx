import './scale.css';
import type { PastControls } from '../../../past/past_types.ts';
import { useMomentsText, usePastText } from '../../text/late.ts';
import { spanWords } from '../../words/moment.ts';
import { ALL, chosenScale, scalesOf, stepScale } from './scales.ts';

/** The choice of the time span of the line. With two options both are shown, or only the current one if space is short; with
 *  more, they are in a list between two buttons. */
export function ScaleChoice({
  controls,
  scale,
  windowMs,
}: {
  controls: PastControls;
  /** The scale that is shown. */
  scale: number;
  /** The length of the available past. */
  windowMs: number;
}) {
  const scales = scalesOf(windowMs);
  const words = (ms: number) => spanWords(ms === ALL ? windowMs : ms);
  if (scales.length === 2) return <TwoScales {...{ controls, scale, scales, words }} />;
  return <Scales {...{ controls, scale, scales, words }} />;
}

interface Given {
  readonly controls: PastControls;
  readonly scale: number;
  readonly scales: readonly number[];
  readonly words: (scale: number) => string;
}

function TwoScales({ controls, scale, scales, words }: Given) {
  const text = usePastText();
  const other = scales.find((each) => each !== scale) ?? ALL;
  const name = text.showLast(words(other));
  return (
    <button
      type="button"
      className="segments range"
      aria-label={name}
      title={name}
      data-testid="range"
      onClick={() => chosenScale(controls).set(other)}
    >
      {scales.map((each) => (
        <span key={each} data-on={each === scale}>
          {words(each)}
        </span>
      ))}
    </button>
  );
}

function Scales({ controls, scale, scales, words }: Given) {
  const text = useMomentsText();
  const step = (by: 1 | -1, name: string, sign: string) => (
    <button
      type="button"
      className="icon-button scale-step"
      aria-label={name}
      title={name}
      disabled={scale === (by < 0 ? scales[0] : scales.at(-1))}
      onClick={() => stepScale(controls, by)}
    >
      {sign}
    </button>
  );
  return (
    <fieldset className="scale">
      <legend className="unseen">{text.scale}</legend>
      {step(1, text.scaleMore, '−')}
      <select
        className="transport-speed scale-list"
        aria-label={text.scale}
        title={text.scale}
        value={scale}
        data-testid="scale"
        onChange={(event) => chosenScale(controls).set(Number(event.currentTarget.value))}
      >
        {scales.map((each) => (
          <option key={each} value={each}>
            {words(each)}
          </option>
        ))}
      </select>
      {step(-1, text.scaleLess, '+')}
    </fieldset>
  );
}
