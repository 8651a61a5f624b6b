import { useSyncExternalStore } from 'react';
import type { Store } from '../../browser/store.ts';

/** The value of a store, in a component that is drawn again with every other value. */
export function useStore<T>(store: Store<T>): T {
  return useSyncExternalStore(store.subscribe, store.get);
}
