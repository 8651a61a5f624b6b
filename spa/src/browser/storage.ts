/** Texts in this browser's local storage, by key. Storage throws in third-party iframes and in some private windows. These
 *  functions don't throw: there they find and keep nothing. */

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
