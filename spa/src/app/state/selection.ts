import { useSyncExternalStore } from 'react';
import { createStore } from '../../browser/store.ts';

/** What a person looks at: a joint as the robot names it, and where they chose it. */
export interface Selection {
  readonly joint: string;
  readonly from: 'body' | 'numbers';
}

/** One for the whole page; null: nothing. */
const selected = createStore<Selection | null>(null);

export const selection = selected.get;
export const onSelection = selected.subscribe;

/** Choosing the same joint again is told again: the camera goes back to it. */
export function selectJoint(joint: string | null, from: Selection['from'] = 'numbers'): void {
  if (joint === null && selection() === null) return;
  selected.set(joint === null ? null : { joint, from });
}

export function useSelectedJoint(): string | null {
  return useSyncExternalStore(onSelection, () => selection()?.joint ?? null);
}
