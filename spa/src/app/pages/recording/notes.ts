import type { Note } from '../../../past/recording/recording_index.ts';
import { isolated } from '../../../twin/names.ts';
import { pxAt, type View } from '../../past/time_line/track_view.ts';

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
