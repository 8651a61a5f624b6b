import { useMore } from '../text/language.ts';

/** A labelled check box in the style of a switch. `explain`: the key of its explanation, if it has one. */
export function Switch(props: {
  on: boolean;
  onChange: (on: boolean) => void;
  text: string;
  explain?: `${'signs' | 'balance'}.${string}`;
}) {
  const { on, onChange, text, explain } = props;
  const rest = useMore();
  return (
    <label className="switch">
      <span>{text}</span>
      {explain !== undefined && (
        <button
          type="button"
          className="explain-mark"
          data-explain={explain}
          aria-haspopup="dialog"
          aria-label={rest.explainIt(text)}
        >
          ?
        </button>
      )}
      <input type="checkbox" checked={on} onChange={(e) => onChange(e.target.checked)} />
    </label>
  );
}
