import '../../shell/styles/choices.css';
import { useText } from '../../text/language.ts';
import { useSaveText } from './save_text.ts';
import { choicesOf, fieldOf, type SpanFields, type SpanName, type SpanOffer } from './span_choice.ts';

/** The span to save: the loop, the last minutes, or from one moment to another. */
export function SpanChoice(props: {
  offer: SpanOffer;
  name: SpanName;
  fields: SpanFields;
  isBusy: boolean;
  onName: (name: SpanName) => void;
  onFields: (fields: SpanFields) => void;
}) {
  const { offer, name, fields, isBusy, onName, onFields } = props;
  const text = useSaveText();
  const { minutes } = useText();
  const label = (each: SpanName) =>
    each === 'loop' || each === 'all' ? text[each] : each === 'custom' ? text.fromTo : minutes(Number(each));
  const bounds = { min: fieldOf(offer.oldestMs), max: fieldOf(offer.nowMs + 1000), step: 1 };
  return (
    <fieldset className="choice" disabled={isBusy}>
      <legend>{text.span}</legend>
      <div className="segments">
        {choicesOf(offer).map((each) => (
          <label key={each}>
            <input
              type="radio"
              name="save-span"
              checked={each === name}
              data-testid={`save-span-${each}`}
              onChange={() => onName(each)}
            />
            <span>{label(each)}</span>
          </label>
        ))}
      </div>
      {name === 'custom' && (
        <div className="save-fields">
          {(['from', 'to'] as const).map((end) => (
            <label key={end}>
              {text[end]}
              <input
                className="dialog-field"
                type="datetime-local"
                value={fields[end]}
                data-testid={`save-${end}`}
                onChange={({ currentTarget: { value } }) => onFields({ ...fields, [end]: value })}
                {...bounds}
              />
            </label>
          ))}
        </div>
      )}
    </fieldset>
  );
}
