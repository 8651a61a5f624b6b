import { changeSettings, useSettings } from '../../state/settings.ts';
import { useMore } from '../../text/more.ts';

const SHOWN = ['pos', 'ref', 'both'] as const;

/** Which joint values a body shows. */
export function ShownChoice() {
  const { shown } = useSettings();
  const text = useMore();
  const called = { pos: text.showPos, ref: text.showRef, both: text.showBoth };
  const words = { pos: text.whereItIs, ref: text.whereTold, both: text.whereBoth };
  return (
    <fieldset className="segments">
      <legend className="unseen">{text.whatTheBodyShows}</legend>
      {SHOWN.map((choice) => (
        <label key={choice}>
          <input
            type="radio"
            name="shown"
            checked={shown === choice}
            onChange={() => changeSettings({ shown: choice })}
          />
          <span title={words[choice]}>{called[choice]}</span>
        </label>
      ))}
    </fieldset>
  );
}
