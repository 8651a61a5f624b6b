/** What this browser keeps, by key. Storage throws in a third-party iframe and in some private windows: there nothing is found,
 *  and what is kept lasts as long as the page. */

export function readStored(key: string): string | null {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

/** Keeps a text; null removes it. */
export function writeStored(key: string, text: string | null): void {
  try {
    if (text === null) localStorage.removeItem(key);
    else localStorage.setItem(key, text);
  } catch {
    // no storage here, or it is full
  }
}
