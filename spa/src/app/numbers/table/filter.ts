import { createStore } from '../../../kit.ts';

/** The filter text of the joint table. It is kept as long as the page is open, also when the schema or the tab changes. */
const text = createStore('');
let words: readonly string[] = [];

/** Longest filter text; the rest is cut off. */
const LONGEST = 100;

export const filterText = text.get;
export const onFilter = text.subscribe;

export function setFilter(next: string): void {
  if (next === text.get()) return;
  const kept = next.slice(0, LONGEST);
  words = kept.toLowerCase().split(/\s+/).filter(Boolean);
  text.set(kept);
}

/** Whether `haystack` (lower case) contains every word of the filter. */
export function matchesFilter(haystack: string): boolean {
  return words.every((word) => haystack.includes(word));
}

/** Whether there is a filter text. */
export function hasFilter(): boolean {
  return words.length > 0;
}
