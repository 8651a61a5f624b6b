import { Fragment } from 'react';
import type { Span } from '../../../past/past_types.ts';
import { formatClockSeconds } from '../../../twin/format.ts';
import { useSaveText } from '../../text/late.ts';
import type { saveEn } from '../../text/late_en.ts';
import { dayWords } from '../../words/moment.ts';
import type { Failure, Measured, Saving } from './use_saving.ts';

const UNITS = ['kB', 'MB', 'GB'] as const;

/** "840 kB", "3.4 MB", "120 MB"; kB = 1000 bytes. */
export function bytesWords(bytes: number): string {
  let size = Math.max(1, bytes) / 1000;
  let unit = 0;
  while (size >= 999.5 && unit < UNITS.length - 1) {
    size /= 1000;
    unit += 1;
  }
  return `${size < 9.95 ? Math.max(0.1, size).toFixed(1) : Math.round(size)} ${UNITS[unit]}`;
}

/** A gap this short at the end of the newest segment is not mentioned, ms. */
const NEAR_MS = 500;
const FAILURES = {
  nothing: 'nothing',
  'too-long': 'tooLong',
  away: 'away',
  failed: 'failed',
} as const satisfies Record<Failure, keyof typeof saveEn>;

/** The chosen span and what saving it will give. `span`: null while none is chosen. */
export function MeasureLine({
  span,
  measured,
  nowMs,
}: {
  span: Span | null;
  measured: Measured;
  nowMs: number;
}) {
  const text = useSaveText();
  const isMeasured = measured !== null && typeof measured !== 'string';
  return (
    <div className="save-measure" data-testid="save-measure" aria-live="polite">
      {span === null ? (
        <p className="save-wrong">{text.noSpan}</p>
      ) : (
        <>
          <p>
            {dayWords(span.fromMs, nowMs)} – {formatClockSeconds(span.toMs)}
          </p>
          {measured === null && <p className="quiet">{text.measuring}</p>}
          {typeof measured === 'string' && <p className="save-wrong">{text[FAILURES[measured]]}</p>}
          {isMeasured && (
            <p className="quiet">{text.measured(measured.frames, bytesWords(measured.bytes))}</p>
          )}
          {isMeasured && measured.untilMs < span.toMs - NEAR_MS && (
            <p className="quiet" data-testid="save-until">
              {text.notYet(formatClockSeconds(measured.untilMs))}
            </p>
          )}
        </>
      )}
    </div>
  );
}

/** The progress. */
export function Progress({ part, onCancel }: { part: number; onCancel: () => void }) {
  const text = useSaveText();
  return (
    <div className="save-work">
      <progress aria-label={text.saving} value={part} data-testid="save-progress" />
      <button type="button" className="text-button" data-testid="save-cancel" onClick={onCancel}>
        {text.cancel}
      </button>
    </div>
  );
}

/** The result, and what is missing in the file. */
export function Outcome({ saving }: { saving: Saving }) {
  const text = useSaveText();
  return (
    <div className="save-outcome" aria-live="polite" data-testid="save-outcome" data-at={saving.at}>
      {saving.at === 'failed' && <p className="save-wrong">{text[FAILURES[saving.why]]}</p>}
      {saving.at === 'done' && (
        <>
          <p>{text.saved(saving.file.name, bytesWords(saving.file.blob.size))}</p>
          {saving.file.lost.segments > 0 && (
            <p className="save-wrong">{text.lostSegments(saving.file.lost.segments)}</p>
          )}
          {saving.file.lost.models > 0 && <p className="save-wrong">{text.lostModel}</p>}
        </>
      )}
    </div>
  );
}

/** A file of a whole recording for other programs, which lies beside the page. */
export interface OfferedFile {
  /** As people call it: `CSV`. */
  readonly format: string;
  readonly url: string;
  /** As it is called once it is on the viewer's computer. */
  readonly name: string;
  readonly bytes: number;
}

/** Links to them. */
export function OfferedFiles({ files }: { files: readonly OfferedFile[] }) {
  return files.map(({ format, url, name, bytes }, i) => (
    <Fragment key={format}>
      {i > 0 && ' · '}
      <a href={url} download={name} className="offered-file">
        {format} ({bytesWords(bytes)})
      </a>
    </Fragment>
  ));
}
