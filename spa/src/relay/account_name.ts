import { writeStored } from '../browser/storage.ts';
import { createStore } from '../kit.ts';
import { ACCOUNT } from './relay.ts';

/** The name of the signed-in account, or null. Kept in this browser, so that the page knows at its next visit whether
 *  to restore a session. */
const name = createStore<string | null>(null);

export const accountName = name.get;
export const onAccountName = name.subscribe;

/** Sets and stores the name and notifies listeners; null when nobody is signed in. */
export function setAccountName(next: string | null): void {
  writeStored(ACCOUNT, next);
  name.set(next);
}
