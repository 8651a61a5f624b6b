import { useCallback, useSyncExternalStore } from 'react';

/** Whether a CSS media query matches. The component is drawn again when that changes. */
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

/** The media query for showing the numbers beside the body: wide windows, and phones held sideways. Otherwise they are a
 *  sheet over the body. */
export const SIDE_BY_SIDE = '(min-width: 700px), (orientation: landscape) and (min-width: 560px)';

/** The media query for windows with room for both the joint table and a joint's card below it. */
export const ROOM_FOR_BOTH = '(min-width: 700px) and (min-height: 640px)';
