import type { Note } from '../../../past/recording/recording_index.ts';
import type { View } from '../../past/time_line/track_view.ts';
import { useRecordingText } from '../../text/late.ts';
import { noteMarks, noteWords } from './notes.ts';
import { recordedWords } from './recording_words.ts';

/** The notes of a recording, in a row under its time line. Each is a button: hovering shows the note, pressing goes to its
 *  moment. */
export function NoteMarks({
  notes,
  view,
  onPoint,
  onGo,
}: {
  notes: readonly Note[];
  view: View;
  /** Called with the notes under the pointer, or null. */
  onPoint: (notes: readonly Note[] | null) => void;
  onGo: (atMs: number) => void;
}) {
  const text = useRecordingText();
  return (
    <fieldset className="note-marks">
      <legend className="unseen">{text.notes}</legend>
      {noteMarks(notes, view).map(({ xPx, notes: here }) => {
        const said = here.map(noteWords).join(' · ');
        const first = here[0]!;
        return (
          <button
            key={first.atMs}
            type="button"
            className="note-mark"
            style={{ left: `${xPx}px` }}
            aria-label={`${recordedWords(first.atMs)}: ${said}`}
            data-testid="note-mark"
            onPointerEnter={({ pointerType }) => pointerType === 'mouse' && onPoint(here)}
            onPointerLeave={() => onPoint(null)}
            onFocus={({ target }) => target.matches(':focus-visible') && onPoint(here)}
            onBlur={() => onPoint(null)}
            onClick={() => {
              onPoint(null);
              onGo(first.atMs);
            }}
          >
            <svg viewBox="0 0 16 16" aria-hidden="true">
              <path d="M3 2.5h10a1.5 1.5 0 0 1 1.5 1.5v6a1.5 1.5 0 0 1-1.5 1.5H9.5L8 14l-1.5-2.5H3A1.5 1.5 0 0 1 1.5 10V4A1.5 1.5 0 0 1 3 2.5z" />
            </svg>
            {here.length > 1 && <b>{here.length}</b>}
          </button>
        );
      })}
    </fieldset>
  );
}
