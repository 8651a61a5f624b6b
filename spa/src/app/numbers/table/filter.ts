/** What the joint table is looked through for. It lasts as long as the page, whatever schema or tab comes. */
let text = '';
let words: readonly string[] = [];
const listeners = new Set<() => void>();

/** Longer than any name; what is pasted beyond is cut off. */
const LONGEST = 100;

export function filterText(): string {
  return text;
}

export function setFilter(next: string): void {
  if (next === text) return;
  text = next.slice(0, LONGEST);
  words = text.toLowerCase().split(/\s+/).filter(Boolean);
  for (const listener of listeners) listener();
}

/** Whether a row that says `haystack` (lower case) is looked for: it holds every word. */
export function passes(haystack: string): boolean {
  return words.every((word) => haystack.includes(word));
}

/** Whether anything is looked for. */
export function anyFilter(): boolean {
  return words.length > 0;
}

export function onFilter(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}
