import { useSyncExternalStore } from 'react';
import type { PastControls } from '../../../past/past_types.ts';
import type { Note } from '../../../past/recording/recording_index.ts';
import { noteShownAt } from './notes.ts';

/** The note of the shown moment; null if none is due. The component is redrawn when that changes. */
export function useDueNote(controls: PastControls, notes: readonly Note[]): Note | null {
  return useSyncExternalStore(controls.onChange, () => noteShownAt(notes, controls.playhead.momentMs));
}
