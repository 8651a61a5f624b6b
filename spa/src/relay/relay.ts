/**
 * Which relay this page reads: the origin that served the page, below whatever path it lies, unless the page's
 * `config.json` or its address say otherwise (`config.ts`, which comes only then).
 */

import { readStored } from '../browser/storage.ts';
import { asAnyone } from './as_anyone.ts';
import type { Accounts, Choice } from './config.ts';

/** A page without an answer goes on with its own origin, and for good: so a slow line, and a device too busy to take the
 *  answer, are given time. It comes from where the page came from, and the stream from there has begun (`early.ts`). */
const CONFIG_LATE_MS = 30_000;

/** What in an address asks for something else than the page's own origin. */
export const ELSEWHERE = /[?&](relay|source)=/;

/** Where the name of whoever is signed in stands, in this browser. */
export const ACCOUNT = 'posecast.account';

/** Set once `relaySettled`; none in a frame of somebody else's. */
export let accounts: Accounts | null = null;
let choice: Choice | null = null;
let asking: Promise<Choice> | null = null;

/** The folder where the page, its `config.json` and its chunks lie; `/embed/` lies one deeper. */
export function home(): string {
  return new URL(document.documentElement.dataset.home ?? './', window.location.href.replace(/[?#].*$/, ''))
    .href;
}

/** As far as is known: before `relaySettled` the page's own origin. */
export function relayChoice(): Choice {
  return choice ?? { base: home(), mirror: null, refused: null };
}

/** Asks once. From then on the browser itself lets the page talk to nobody else. */
export function relaySettled(): Promise<Choice> {
  asking ??= (async () => {
    let body: object | null = null;
    try {
      const signal = AbortSignal.timeout(CONFIG_LATE_MS);
      const answer = await fetch(new URL('config.json', home()), { signal, cache: 'no-cache' });
      if (answer.ok) body = await answer.json();
    } catch {
      // none, or none in time
    }
    const { search } = window.location;
    const plain = (body === null || Object.keys(body).length === 0) && !ELSEWHERE.test(search);
    let settled = relayChoice();
    let further = '';
    if (!plain) {
      const { readConfig, chooseRelay, furtherSources } = await import('./config.ts');
      const config = readConfig(body);
      settled = chooseRelay(home(), search, config);
      if (document.documentElement.dataset.page !== 'embed' && !asAnyone()) accounts = config.accounts;
      further = furtherSources(settled.mirror, accounts);
    }
    choice = settled;
    if (import.meta.env.PROD && settled.base !== null) allowOnly(new URL(settled.base), further);
    return settled;
  })();
  return asking;
}

/** Whoever never signed in here never loads what signs in. */
export function wasSignedIn(): boolean {
  return readStored(ACCOUNT) !== null;
}

/** A second policy beside the page's own: what is allowed is allowed by both. */
function allowOnly({ origin, host, protocol }: URL, further: string): void {
  const meta = document.createElement('meta');
  meta.httpEquiv = 'Content-Security-Policy';
  const socket = `${protocol === 'https:' ? 'wss' : 'ws'}://${host}`;
  meta.content = `connect-src 'self' ${origin} ${socket} ${further} blob: data:; img-src 'self' ${origin} blob: data:`;
  document.head.append(meta);
}
