import { readStored, writeStored } from '../browser/storage.ts';
import { createStore } from '../kit.ts';

/** The tokens of this page: that of the share link that opened it (for one robot), and that of the signed-in account. Tokens are
 *  never put into an address. */

let held = '';
const account = createStore('');
let withheldBelow: string | null = null;

export function setLinkToken(token: string): void {
  held = token;
}

/** Withholds all tokens from every URL below an address. */
export function withholdTokens(below: string): void {
  withheldBelow = below;
}

/** Sets the account's token; '' when nobody is signed in. */
export function setAccountToken(token: string): void {
  if (token !== account.get()) account.set(token);
}

/** Calls a listener when the account or its token changes. Returns a function that removes it. */
export const onAccountToken = account.subscribe;

/** The token for a URL at this relay: the share link's for its robot, else the account's; undefined if there is none. Lane URLs
 *  never get a token: a lane serves what anyone may see, and may lead to third-party caches. */
export function tokenFor(url: string): string | undefined {
  if (withheldBelow !== null && url.startsWith(withheldBelow)) return undefined;
  const robot = held.split('.')[1];
  if (robot && url.includes(`/api/v1/robots/${robot}/`)) return held;
  return (/\/api\/v1\/robots(\/|$)/.test(url) && account.get()) || undefined;
}

/** Whether the address has `?as=anyone`; if so, the page uses no token and shows only what anyone may see. */
export function asAnyone(): boolean {
  return /[?&]as=anyone(&|$)/.test(globalThis.location?.search ?? '');
}

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
