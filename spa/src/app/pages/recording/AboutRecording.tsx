import type { PastControls } from '../../../past/past_types.ts';
import type { RecordingIndex } from '../../../past/recording/recording_index.ts';
import type { RecordingPast } from '../../../past/recording/recording_past.ts';
import { isolated } from '../../../twin/names.ts';
import { type OfferedFile, OfferedFiles } from '../../past/save/Outcome.tsx';
import { Dialog } from '../../shell/Dialog.tsx';
import { useRecordingText } from '../../text/late.ts';
import { noteWords } from './Notes.tsx';
import { useLost } from './recording_link.ts';
import { lengthWords, lostWords, recordedWords } from './recording_words.ts';

/** The dialog about a recording: its subject, its author and its notes; each note links to its moment. */
export function AboutRecording(props: {
  index: RecordingIndex;
  source: RecordingPast;
  controls: PastControls;
  robotName: string;
  offered: readonly OfferedFile[];
  onClose: () => void;
}) {
  const { index, source, controls, robotName, offered, onClose } = props;
  const { title, author, licence, robot, view, fromMs, toMs, notes, segments } = index;
  const text = useRecordingText();
  const lost = lostWords(useLost(source), segments.length);
  const facts = [
    [text.title, title],
    [text.author, author],
    [text.licence, licence],
    [text.robot, robotName === robot ? robot : `${robotName} (${robot})`],
    [text.view, view],
    [text.recordedAt, recordedWords(fromMs)],
    [text.length, lengthWords(toMs - fromMs)],
  ] as const;
  return (
    <Dialog title={text.about} testId="about-recording" onClose={onClose}>
      <dl className="recording-facts">
        {facts.map(
          ([name, value]) =>
            value !== null && (
              <div key={name}>
                <dt>{name}</dt>
                <dd>{isolated(value)}</dd>
              </div>
            ),
        )}
        {offered.length > 0 && (
          <div>
            <dt>{text.data}</dt>
            <dd>
              <OfferedFiles files={offered} />
            </dd>
          </div>
        )}
      </dl>
      {lost !== null && <p>{lost}</p>}
      {notes.length > 0 && (
        <section className="recording-notes" aria-label={text.notes}>
          <h3 className="quiet" data-explain="timeLine.note">
            {text.notes}
          </h3>
          <ol>
            {notes.map((note, i) => (
              // biome-ignore lint/suspicious/noArrayIndexKey: the list never changes, and two may be equal
              <li key={i}>
                <button
                  type="button"
                  data-testid="go-to-note"
                  onClick={() => {
                    onClose();
                    controls.seek(note.atMs);
                  }}
                >
                  <time>{lengthWords(note.atMs - fromMs)}</time>
                  <span className="note-words">{noteWords(note)}</span>
                </button>
              </li>
            ))}
          </ol>
        </section>
      )}
    </Dialog>
  );
}
