import { useCallback, useEffect, useSyncExternalStore } from 'react';
import { useSettings } from '../state/settings.ts';

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

/** A theme that is drawn, after `system` has been resolved. */
export type PageTheme = 'dark' | 'light';

/** The theme in force: the person's choice, or for `system` that of the operating system. */
export function useTheme(): PageTheme {
  const { theme } = useSettings();
  const systemDark = useMedia('(prefers-color-scheme: dark)');
  if (theme !== 'system') return theme;
  return systemDark ? 'dark' : 'light';
}

/** Writes theme and palette to the attributes of the root element that the style sheets select by. */
export function useThemeOnRoot(): void {
  const theme = useTheme();
  const { palette } = useSettings();
  useEffect(() => {
    document.documentElement.dataset.theme = theme;
    document.documentElement.dataset.palette = palette;
  }, [theme, palette]);
}
