/** Colours of traces; from the fifth on they are also dashed. Red is left out, because it means a fault. */
const COLORS = {
  dark: ['#5aa9ff', '#e6b35a', '#4fd1b5', '#c59bff'],
  light: ['#1d6fd1', '#96600a', '#0a7a66', '#7b3fc4'],
} as const;
const DASHES: readonly (readonly number[])[] = [[], [7, 4]];

export interface TraceStyle {
  readonly color: string;
  /** Dash pattern, CSS px: line, gap; empty for a solid line. */
  readonly dash: readonly number[];
}

export function traceStyle(index: number, theme: 'dark' | 'light'): TraceStyle {
  const colors = COLORS[theme];
  return {
    color: colors[index % colors.length]!,
    dash: DASHES[Math.floor(index / colors.length) % DASHES.length]!,
  };
}
