import { readStored, writeStored } from '../browser/storage.ts';
import { createStore } from '../kit.ts';
import { asAnyone, setLinkToken } from './token.ts';

/** What this browser keeps of who visits: the account's name, and for a tab its share link's token. */

/** The name of the signed-in account, or null. Kept in this browser, so that the page knows at its next visit whether
 *  to restore a session. */
const name = createStore<string | null>(null);

export const accountName = name.get;
export const onAccountName = name.subscribe;

const ACCOUNT = 'posecast.account';

/** Whether somebody has signed in here before. If not, the code for accounts is not loaded. */
export function wasSignedIn(): boolean {
  return readStored(ACCOUNT) !== null;
}

/** Sets and stores the name and notifies listeners; null when nobody is signed in. */
export function setAccountName(next: string | null): void {
  writeStored(ACCOUNT, next);
  name.set(next);
}

const STORE = 'posecast.link';
/** `t` may also be a moment, which is a date, or garbage: a token has its robot between dots. */
const MOMENT = /^\d{4}-\d\d-\d\dT/;

/** Removes a share link's token from the address before any request, so that it appears neither in the history nor in a copied
 *  address. It is kept in the tab's storage, so that a reload works. */
export function takeToken(): void {
  const [page, named] = window.location.hash.split('?t=');
  const found = named?.includes('.') && !MOMENT.test(named) ? named : undefined;
  try {
    if (found) sessionStorage.setItem(STORE, found);
    hold(found ?? sessionStorage.getItem(STORE) ?? '');
  } catch {
    hold(found ?? ''); // no storage here
  }
  if (found) history.replaceState(history.state, '', page);
}

function hold(token: string): void {
  setLinkToken(asAnyone() ? '' : token);
}
