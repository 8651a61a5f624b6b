/** Texts kept in this browser's local storage, by key. Storage throws in third-party iframes and some private windows:
 *  there nothing is found and nothing is kept, but these functions don't throw. */

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
