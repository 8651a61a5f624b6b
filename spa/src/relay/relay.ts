/**
 * Which relay this page reads: by default the origin that served the page, below the page's own path, unless
 * `config.json` or the address choose another (`config.ts`, which is loaded only then).
 */

import { readStored } from '../browser/storage.ts';
import { asAnyone } from './as_anyone.ts';
import type { Accounts, Choice } from './config.ts';
import { recordingUrl } from './recording_address.ts';

/** How long to wait for `config.json`, which lies beside the page and is as quick as that. Afterwards the page uses its own origin
 *  for good, so slow lines and busy devices get much time. */
const CONFIG_LATE_MS = 30_000;

/** Matches an address that asks for another source than the page's own origin, or for another way to it. */
const ELSEWHERE = /[?&](relay|source|lane)=/;

/** Storage key of the name of the account that is signed in. */
export const ACCOUNT = 'posecast.account';

/** Set when `relaySettled` resolves; null without accounts, and in a frame of another site. */
export let accounts: Accounts | null = null;
let choice: Choice | null = null;
let asking: Promise<Choice> | null = null;

/** The URL of the folder with the page, its `config.json` and its chunks; `/embed/` is one level deeper. */
export function home(): string {
  return new URL(document.documentElement.dataset.home ?? './', window.location.href.replace(/[?#].*$/, ''))
    .href;
}

/** The chosen relay; before `relaySettled` resolves, the page's own origin. */
export function relayChoice(): Choice {
  return choice ?? { base: home(), mirror: null, lane: null, refused: null };
}

/** Resolves to the chosen relay; asks once. From then on a content policy limits whom the page may talk to. A recording has no
 *  relay: nothing is asked, and its own origin is all that it reads. */
export function relaySettled(): Promise<Choice> {
  asking ??= (async () => {
    const isRecording = recordingUrl() !== null;
    let body: object | null = null;
    try {
      if (isRecording) throw new Error('nothing to ask for');
      const signal = AbortSignal.timeout(CONFIG_LATE_MS);
      const answer = await fetch(new URL('config.json', home()), { signal, cache: 'no-cache' });
      if (answer.ok) body = await answer.json();
    } catch {
      // none, or none in time
    }
    const { search } = window.location;
    const plain =
      isRecording || ((body === null || Object.keys(body).length === 0) && !ELSEWHERE.test(search));
    let settled = relayChoice();
    let further = '';
    if (!plain) {
      const { readConfig, chooseRelay, furtherSources } = await import('./config.ts');
      const config = readConfig(body);
      settled = chooseRelay(home(), search, config);
      if (document.documentElement.dataset.page !== 'embed' && !asAnyone()) accounts = config.accounts;
      further = furtherSources(settled, accounts);
    }
    choice = settled;
    if (import.meta.env.PROD && settled.base !== null) allowOnly(new URL(settled.base), further);
    return settled;
  })();
  return asking;
}

/** Whether somebody has signed in here before. If not, the code for accounts is not loaded. */
export function wasSignedIn(): boolean {
  return readStored(ACCOUNT) !== null;
}

/** Adds a second Content-Security-Policy; a connection must be allowed by both. */
function allowOnly({ origin, host, protocol }: URL, further: string): void {
  const meta = document.createElement('meta');
  meta.httpEquiv = 'Content-Security-Policy';
  const socket = `${protocol === 'https:' ? 'wss' : 'ws'}://${host}`;
  meta.content = `connect-src 'self' ${origin} ${socket} ${further} blob: data:; img-src 'self' ${origin} blob: data:`;
  document.head.append(meta);
}
