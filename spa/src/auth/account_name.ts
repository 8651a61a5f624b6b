import { writeStored } from '../browser/storage.ts';
import { createStore } from '../browser/store.ts';
import { ACCOUNT } from '../relay/relay.ts';

/** Who is signed in, by name; null: nobody. Kept in this browser, so that the page knows whom to ask for when it comes again. */
const name = createStore<string | null>(null);

export const accountName = name.get;
export const onAccountName = name.subscribe;

/** Sets, keeps and tells the name; null: nobody is signed in. */
export function setAccountName(next: string | null): void {
  writeStored(ACCOUNT, next);
  name.set(next);
}
