import type { Threshold } from './limits.ts';

/** The texts for a range in the viewer's language. */
export interface RangeWords {
  readonly atMost: (value: string) => string;
  readonly atLeast: (value: string) => string;
  readonly between: (low: string, high: string) => string;
}

/** A threshold in words: "±5 A", "−30 N to 500 N", "at most 70 °C". `shown` formats a value with its unit. */
export function rangeWords(
  { low, high }: Threshold,
  shown: (value: number) => string,
  words: RangeWords,
): string {
  if (low === null) return words.atMost(shown(high ?? 0));
  if (high === null) return words.atLeast(shown(low));
  return -low === high ? `±${shown(high)}` : words.between(shown(low), shown(high));
}
