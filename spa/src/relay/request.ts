import { createStore } from '../kit.ts';

/**
 * Requests for data. Before the page's own origin there may be a proxy that people sign in to: with a cookie (oauth2-proxy,
 * Cloudflare Access) or a password (basic authentication). The browser sends it what it needs, and nothing to any other origin:
 * another relay, a lane, a CDN. That is the default of `fetch`, so no request names `credentials`.
 */

/** Whether such a proxy wants people to sign in before it passes anything on. */
export const signInNeeded = createStore(false);

/** A proxy before the page's own origin has answered instead of the server behind it. */
export class SignInNeeded extends Error {}

/** Like `fetch`, for data. Rejects with `SignInNeeded` if the answer is that of a proxy that people sign in to. */
export async function request(url: string, init: RequestInit = {}): Promise<Response> {
  if (!url.startsWith(`${globalThis.location?.origin}/`)) return fetch(url, init);
  // no server redirects data; a redirect that is followed to a sign-in page of another origin looks like no network
  const answer = await fetch(url, { ...init, redirect: 'manual' });
  const isNeeded = isSignIn(answer, url, init);
  if (isNeeded !== signInNeeded.get()) signInNeeded.set(isNeeded);
  if (isNeeded) throw new SignInNeeded('sign in again');
  return answer;
}

function isSignIn({ headers, status, type }: Response, url: string, init: RequestInit): boolean {
  if (type === 'opaqueredirect') return true;
  if (status === 401) {
    const challenge = headers.get('www-authenticate') ?? '';
    // a relay's own; or one of basic authentication, whose header the page's token has replaced
    const isOther = /^basic/i.test(challenge) && new Headers(init.headers).has('authorization');
    return challenge !== 'Bearer' && !isOther;
  }
  if (!/^text\/html/i.test(headers.get('content-type') ?? '')) return false;
  // elsewhere, hosts may answer a missing file with a page
  return status === 403 || (status < 300 && url.includes('/api/v1/'));
}
