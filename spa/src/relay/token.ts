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
