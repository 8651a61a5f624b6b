import type { Accounts, Choice } from './config.ts';
import { asAnyone } from './token.ts';

/**
 * Which relay this page reads: by default the origin that served the page, below the page's own path, unless `config.json` or the
 * address select another (`config.ts`, loaded only in that case).
 */

/** How long to wait for `config.json`, which is as fast to load as the page beside it. After that the page uses its own origin
 *  for good, so the limit is generous for slow connections and busy devices. */
const CONFIG_LATE_MS = 30_000;

/** Matches an address that requests a source other than the page's own origin, or another way to it. */
const ELSEWHERE = /[?&](relay|source|lane)=/;

/** Set when `relaySettled` resolves; null without accounts, and in another site's frame. */
export let accounts: Accounts | null = null;
let choice: Choice | null = null;
let asking: Promise<Choice> | null = null;

/** The URL of the folder with the page, its `config.json` and its chunks; `/embed/` is one level deeper. */
export function home(): string {
  return new URL(document.documentElement.dataset.home ?? './', window.location.href.replace(/[?#].*$/, ''))
    .href;
}

/** The selected relay; until `relaySettled` resolves, the page's own origin. */
export function relayChoice(): Choice {
  return choice ?? { base: home(), mirror: null, lane: null, refused: null };
}

/** Resolves to the selected relay; decided once. From then on, a Content-Security-Policy limits which hosts the page may contact.
 *  A recording has no relay: nothing is requested, and it reads only its own origin. */
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
      // missing, or too late
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

/** Adds a second Content-Security-Policy; a connection must be allowed by both. */
function allowOnly({ origin, host, protocol }: URL, further: string): void {
  const meta = document.createElement('meta');
  meta.httpEquiv = 'Content-Security-Policy';
  const socket = `${protocol === 'https:' ? 'wss' : 'ws'}://${host}`;
  meta.content = `connect-src 'self' ${origin} ${socket} ${further} blob: data:; img-src 'self' ${origin} blob: data:`;
  document.head.append(meta);
}

/** An exported recording is this page with a `<meta name="posecast-recording">` that names its `recording.json`. */

/** The address of the recording that this page was exported with; null if there is none. */
export function recordingUrl(): string | null {
  const meta = document.querySelector<HTMLMetaElement>('meta[name="posecast-recording"]');
  return meta === null ? null : new URL(meta.content, window.location.href.replace(/[?#].*$/, '')).href;
}

/** The early request for that address, sent before the code that reads its answer had loaded; null if there is none. */
export const early: {
  request: { readonly answer: Promise<Response>; readonly stop: AbortController } | null;
} = {
  request: null,
};
