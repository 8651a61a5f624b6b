import { useCallback, useSyncExternalStore } from 'react';

export function useMedia(query: string): boolean {
  const subscribe = useCallback(
    (listener: () => void) => {
      const list = window.matchMedia(query);
      list.addEventListener('change', listener);
      return () => list.removeEventListener('change', listener);
    },
    [query],
  );
  return useSyncExternalStore(subscribe, () => window.matchMedia(query).matches);
}

/** Beside each other where there is room, and on a phone held sideways; else the numbers are a sheet over the body. */
export const SIDE_BY_SIDE = '(min-width: 700px), (orientation: landscape) and (min-width: 560px)';

/** Room for the table and a joint's card under it: beside the body, and high enough for both. */
export const ROOM_FOR_BOTH = '(min-width: 700px) and (min-height: 640px)';
