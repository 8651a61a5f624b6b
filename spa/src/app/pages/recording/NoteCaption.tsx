import './notes.css';
import { useEffect, useLayoutEffect, useRef, useState } from 'react';
import type { PastControls } from '../../../past/past_types.ts';
import type { Note } from '../../../past/recording/recording_index.ts';
import { useRecordingText } from '../../text/late.ts';
import { noteWords } from './notes.ts';
import { useDueNote } from './use_due_note.ts';

/** The notes under the pointer, or else the note of the shown moment, in one or two lines. A longer note ends in `…`; a press
 *  opens all of it until it is closed or another note is due. The space is kept when there is no note. */
export function NoteCaption(props: {
  controls: PastControls;
  notes: readonly Note[];
  pointed?: readonly Note[] | null;
}) {
  const { controls, notes, pointed = null } = props;
  const text = useRecordingText();
  const due = useDueNote(controls, notes);
  const [opened, setOpened] = useState<Note | null>(null);
  useEffect(() => {
    if (due !== null) setOpened((note) => (note === due ? note : null));
  }, [due]);
  const shown = opened ?? due;
  const words = (pointed ?? (shown === null ? [] : [shown])).map(noteWords).join(' · ');
  const isOpen = opened !== null && pointed === null;
  const { room, isCut } = useCut(words, isOpen);
  const said = (
    <span className="note-said" ref={room}>
      {words}
    </span>
  );
  return (
    <div className="note-caption" role="status" data-open={isOpen} data-testid="note-caption">
      {isOpen || (isCut && pointed === null) ? (
        <button
          type="button"
          aria-expanded={isOpen}
          title={isOpen ? text.closeNote : text.openNote}
          onClick={() => setOpened(isOpen ? null : shown)}
          onKeyDown={(event) => {
            if (event.key !== 'Escape' || !isOpen) return;
            event.stopPropagation(); // so that the key does nothing else
            setOpened(null);
          }}
        >
          {said}
          <svg className="note-fold" viewBox="0 0 10 6" aria-hidden="true">
            <path d="M1 5l4-4 4 4" />
          </svg>
        </button>
      ) : (
        said
      )}
    </div>
  );
}

/** Whether an element cuts its text. While it is open this does not apply. */
function useCut(words: string, isOpen: boolean) {
  const room = useRef<HTMLSpanElement>(null);
  const [isCut, setCut] = useState(false);
  // biome-ignore lint/correctness/useExhaustiveDependencies: words and isCut change the element or its length
  useLayoutEffect(() => {
    const element = room.current;
    if (element === null || isOpen) return;
    const measure = () => setCut(element.scrollHeight > element.clientHeight + 1);
    measure();
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    return () => observer.disconnect();
  }, [words, isOpen, isCut]);
  return { room, isCut };
}
