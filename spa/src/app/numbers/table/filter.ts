import { createStore } from '../../../browser/store.ts';

/** What the joint table is looked through for. It lasts as long as the page, whatever schema or tab comes. */
const text = createStore('');
let words: readonly string[] = [];

/** Longer than any name; what is pasted beyond is cut off. */
const LONGEST = 100;

export const filterText = text.get;
export const onFilter = text.subscribe;

export function setFilter(next: string): void {
  if (next === text.get()) return;
  const kept = next.slice(0, LONGEST);
  words = kept.toLowerCase().split(/\s+/).filter(Boolean);
  text.set(kept);
}

/** Whether a row that says `haystack` (lower case) is looked for: it holds every word. */
export function matchesFilter(haystack: string): boolean {
  return words.every((word) => haystack.includes(word));
}

/** Whether anything is looked for. */
export function hasFilter(): boolean {
  return words.length > 0;
}
