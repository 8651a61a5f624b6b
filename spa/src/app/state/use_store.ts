import { useSyncExternalStore } from 'react';
import type { Store } from '../../kit.ts';

/** The value of a store. The component is drawn again when it changes. */
export function useStore<T>(store: Store<T>): T {
  return useSyncExternalStore(store.subscribe, store.get);
}
