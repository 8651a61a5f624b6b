import './notes.css';
import type { PastControls } from '../../../../past/past_types.ts';
import type { Note } from '../../../../past/recording/recording_index.ts';
import { useRecordingText } from '../words/recording_text.ts';
import { noteWords } from './notes.ts';
import { useDueNote } from './use_due_note.ts';

/** A note with more letters is written smaller. */
const LONG_LETTERS = 200;

/** The note of the shown moment, large, for a presentation. One that is longer than its place is scrolled. */
export function PresentedNote({ controls, notes }: { controls: PastControls; notes: readonly Note[] }) {
  const note = useDueNote(controls, notes);
  const { notes: name } = useRecordingText();
  return (
    note !== null && (
      <section
        className="present-note"
        key={note.atMs}
        // biome-ignore lint/a11y/noNoninteractiveTabindex: a long one is scrolled by keys, too
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
