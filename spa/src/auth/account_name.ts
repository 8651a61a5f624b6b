import { ACCOUNT } from '../relay/relay.ts';

/** Who is signed in, by name; null: nobody. Kept in this browser, so that the page knows whom to ask for when it comes again. */

let name: string | null = null;
const listeners = new Set<() => void>();

/** Sets, keeps and tells the name; null: nobody is signed in. */
export function setAccountName(next: string | null): void {
  try {
    if (next === null) localStorage.removeItem(ACCOUNT);
    else localStorage.setItem(ACCOUNT, next);
  } catch {
    // no storage here: for as long as this page lives
  }
  name = next;
  for (const listener of listeners) listener();
}

export function accountName(): string | null {
  return name;
}

/** Tells of every change of the name. Returns the end of it. */
export function onAccountName(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}
