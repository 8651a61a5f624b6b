import { useEffect } from 'react';
import { useSettings } from '../state/settings.ts';
import { useMedia } from './media.ts';

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
