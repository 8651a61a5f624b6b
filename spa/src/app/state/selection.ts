import { useSyncExternalStore } from 'react';

/** What a person looks at: a joint as the robot names it, and where they chose it. */
export interface Selection {
  readonly joint: string;
  readonly from: 'body' | 'numbers';
}

/** One for the whole page; null: nothing. */
let selected: Selection | null = null;
const listeners = new Set<() => void>();

/** Choosing the same joint again is told again: the camera goes back to it. */
export function selectJoint(joint: string | null, from: Selection['from'] = 'numbers'): void {
  if (joint === null && selected === null) return;
  selected = joint === null ? null : { joint, from };
  for (const listener of listeners) listener();
}

export function selection(): Selection | null {
  return selected;
}

export function onSelection(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export function useSelectedJoint(): string | null {
  return useSyncExternalStore(onSelection, () => selected?.joint ?? null);
}
