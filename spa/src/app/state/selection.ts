import { useSyncExternalStore } from 'react';
import { createStore } from '../../kit.ts';

/** The selected joint, by its label in the robot's schema, and where it was selected. */
export interface Selection {
  readonly joint: string;
  readonly from: 'body' | 'numbers';
}

/** One selection for the whole page; null: nothing is selected. */
const selected = createStore<Selection | null>(null);

/** The selected joint; null: none. */
export const selection = selected.get;
/** Adds a listener that is called at each selection. Returns a function that removes it. */
export const onSelection = selected.subscribe;

/** Selects a joint by its label; null: none. Selecting the same joint again also notifies listeners, so that the camera returns
 *  to it. */
export function selectJoint(joint: string | null, from: Selection['from'] = 'numbers'): void {
  if (joint === null && selection() === null) return;
  selected.set(joint === null ? null : { joint, from });
}

/** The label of the selected joint; null: none. The component is drawn again when it changes. */
export function useSelectedJoint(): string | null {
  return useSyncExternalStore(onSelection, () => selection()?.joint ?? null);
}
