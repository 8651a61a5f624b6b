import './notes.css';
import { useEffect, useLayoutEffect, useRef, useState, useSyncExternalStore } from 'react';
import type { PastControls } from '../../../past/past_types.ts';
import type { Note } from '../../../past/recording/recording_index.ts';
import { isolated } from '../../../twin/names.ts';
import { pxAt, type View } from '../../past/time_line/track_view.ts';
import { useRecordingText } from '../../text/late.ts';
import { recordedWords } from './recording_words.ts';

/** A note is shown for this long after its moment, ms. */
export const NOTE_SHOWN_MS = 8000;
/** Notes closer than this share a mark, CSS px: the width of a finger. */
export const TOGETHER_PX = 26;

/** One or more notes so close together that they share a mark. */
export interface NoteMark {
  readonly xPx: number;
  readonly notes: readonly Note[];
}

/** A note's text, line by line, safe to show (`isolated`). */
export function noteWords({ text }: Note): string {
  return text
    .trim()
    .split(/\r\n?|\n/)
    .map(isolated)
    .join('\n');
}

/** The newest note at or before a moment, unless it is too old. `notes`: ascending. */
export function noteShownAt(notes: readonly Note[], momentMs: number): Note | null {
  const note = notes.findLast(({ atMs }) => atMs <= momentMs);
  return note !== undefined && momentMs - note.atMs <= NOTE_SHOWN_MS ? note : null;
}

/** The marks of the notes that are in view, no two of them nearer than `TOGETHER_PX`. */
export function noteMarks(notes: readonly Note[], view: View): readonly NoteMark[] {
  const marks: { xPx: number; notes: Note[] }[] = [];
  for (const note of notes) {
    if (note.atMs < view.fromMs || note.atMs > view.toMs) continue;
    const xPx = pxAt(view, note.atMs);
    const last = marks.at(-1);
    if (last !== undefined && xPx - last.xPx < TOGETHER_PX) last.notes.push(note);
    else marks.push({ xPx, notes: [note] });
  }
  return marks;
}

/** The note of the shown moment; null if none is due. The component is redrawn when that changes. */
export function useDueNote(controls: PastControls, notes: readonly Note[]): Note | null {
  return useSyncExternalStore(controls.onChange, () => noteShownAt(notes, controls.playhead.momentMs));
}

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
