import { useEffect } from 'react';
import { useSettings } from '../state/settings.ts';
import { useMedia } from './media.ts';

export type PageTheme = 'dark' | 'light';

/** The theme in force: the person's choice, else the system's. */
export function useTheme(): PageTheme {
  const { theme } = useSettings();
  const systemDark = useMedia('(prefers-color-scheme: dark)');
  if (theme !== 'system') return theme;
  return systemDark ? 'dark' : 'light';
}

/** Writes it where the style sheet looks. */
export function useThemeOnRoot(): void {
  const theme = useTheme();
  const { palette } = useSettings();
  useEffect(() => {
    document.documentElement.dataset.theme = theme;
    document.documentElement.dataset.palette = palette;
  }, [theme, palette]);
}
