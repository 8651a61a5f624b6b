import { createStore } from '../browser/store.ts';

/** The tokens of this page: of the share link that it was opened with, which opens one robot, and of whoever is signed in.
 *  None ever stands in an address. */

let held = '';
const account = createStore('');

export function setLinkToken(token: string): void {
  held = token;
}

/** Sets the account's token; '' when nobody is signed in. */
export function setAccountToken(token: string): void {
  if (token !== account.get()) account.set(token);
}

/** Tells of another account, and of every newer token of the same. Returns the end of it. */
export const onAccountToken = account.subscribe;

/** For a stream, a file or the list of this relay: the link's for the robot that it opens, else the account's. */
export function tokenFor(url: string): string | undefined {
  const robot = held.split('.')[1];
  if (robot && url.includes(`/api/v1/robots/${robot}/`)) return held;
  return (/\/api\/v1\/robots(\/|$)/.test(url) && account.get()) || undefined;
}
