import './save.css';
import { useEffect, useState } from 'react';
import type { PastSource } from '../../../past/past_source.ts';
import type { PastControls } from '../../../past/past_types.ts';
import type { SaveFormat } from '../../../past/save/saved_span.ts';
import { Dialog } from '../../shell/Dialog.tsx';
import { useText } from '../../text/language.ts';
import { useSaveText } from '../../text/late.ts';
import { MeasureLine, type OfferedFile, OfferedFiles, Outcome, Progress } from './Outcome.tsx';
import {
  choicesOf,
  customSpan,
  fieldOf,
  fieldsOf,
  offerOf,
  type SpanFields,
  type SpanName,
  type SpanOffer,
  spanOf,
} from './span_choice.ts';
import { type ManifestUrl, useMeasure, useSaving } from './use_saving.ts';
import '../../shell/styles/choices.css';

const FORMATS = ['csv', 'posecast'] as const satisfies readonly SaveFormat[];

/** The dialog that saves a span of the past as a file: how much, in which format, and the size. The choices reflect the page when
 *  the dialog opened. */
export function SaveSheet(props: {
  controls: PastControls;
  source: PastSource;
  /** Must not change. */
  manifestUrl: ManifestUrl;
  /** Files of all of it, for other programs. */
  offered?: readonly OfferedFile[] | undefined;
  onClose: () => void;
}) {
  const { controls, source, manifestUrl, offered = [], onClose } = props;
  const text = useSaveText();
  const [offer] = useState(() => offerOf(controls));
  const [name, setName] = useState<SpanName>(choicesOf(offer)[0]!);
  const [fields, setFields] = useState(() => fieldsOf(offer));
  const [format, setFormat] = useState<SaveFormat>('csv');
  const span = name === 'custom' ? customSpan(fields) : spanOf(offer, name);
  const measured = useMeasure(source, manifestUrl, format, span);
  const { saving, save, cancel } = useSaving(source, manifestUrl);
  useEffect(() => controls.attend(), [controls]); // so that the newest end is known soon
  const isBusy = saving.at === 'work';
  /** A message about the previous choice no longer applies. */
  const choose = (change: () => void) => {
    cancel();
    change();
  };
  return (
    <Dialog title={text.title} testId="save" onClose={onClose}>
      <SpanChoice
        {...{ offer, name, fields, isBusy }}
        onName={(next) => choose(() => setName(next))}
        onFields={(next) => choose(() => setFields(next))}
      />
      <fieldset className="choice save-formats" disabled={isBusy}>
        <legend>{text.format}</legend>
        {FORMATS.map((each) => (
          <label key={each}>
            <input
              type="radio"
              name="save-format"
              checked={each === format}
              data-testid={`save-${each}`}
              onChange={() => choose(() => setFormat(each))}
            />
            <span>
              <b>{text.formats[each].name}</b> {text.formats[each].what}
            </span>
          </label>
        ))}
        <p data-testid="save-mcap">
          {text.mcap} <code>posecast convert FILE.posecast OUT.mcap</code>
        </p>
        {offered.length > 0 && (
          <p data-testid="save-offered">
            {text.offered} <OfferedFiles files={offered} />
          </p>
        )}
      </fieldset>
      <MeasureLine span={span} measured={measured} nowMs={offer.nowMs} />
      {isBusy ? (
        <Progress part={saving.part} onCancel={cancel} />
      ) : (
        <button
          type="button"
          className="dialog-go"
          disabled={span === null || measured === null || typeof measured === 'string'}
          data-testid="save-go"
          onClick={() => span !== null && void save(format, span)}
        >
          {text.save}
        </button>
      )}
      <Outcome saving={saving} />
    </Dialog>
  );
}

/** The span to save: the loop, the last minutes, or from one moment to another. */
function SpanChoice(props: {
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
