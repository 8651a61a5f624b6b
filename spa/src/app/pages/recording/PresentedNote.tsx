import './notes.css';
import type { PastControls } from '../../../past/past_types.ts';
import type { Note } from '../../../past/recording/recording_index.ts';
import { useRecordingText } from '../../text/late.ts';
import { noteWords } from './notes.ts';
import { useDueNote } from './use_due_note.ts';

/** Notes longer than this many letters use a smaller font. */
const LONG_LETTERS = 200;

/** The note of the shown moment, large, for presenting. A note that is too long for its space scrolls. */
export function PresentedNote({ controls, notes }: { controls: PastControls; notes: readonly Note[] }) {
  const note = useDueNote(controls, notes);
  const { notes: name } = useRecordingText();
  return (
    note !== null && (
      <section
        className="present-note"
        key={note.atMs}
        // biome-ignore lint/a11y/noNoninteractiveTabindex: keys scroll a long note
        tabIndex={0}
        aria-label={name}
        data-long={note.text.length > LONG_LETTERS}
        data-testid="present-note"
      >
        {noteWords(note)}
      </section>
    )
  );
}
