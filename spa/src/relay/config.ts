/** Reads the `config.json` beside the page, and decides which relay or mirror an address may choose by it. */

/** A Firebase project, by its names in the Firebase console. */
export interface Accounts {
  readonly apiKey: string;
  readonly projectId: string;
  /** Address of a Firebase Auth emulator on this computer, for development. */
  readonly emulator: string | undefined;
}

/** The contents of the `config.json` beside the page. */
export interface Config {
  /** The relay to read unless the address says otherwise; null: the page's own origin. */
  readonly relay: string | null;
  /** Further relays that `?relay=` may name. */
  readonly relays: readonly string[];
  /** The Firebase project in which people sign in; null: no accounts. */
  readonly accounts: Accounts | null;
  /** Address of a mirror in a Firebase Realtime Database, for `?source=firebase`. */
  readonly database: string | null;
}

/** The chosen relay. `base` and `mirror` end with a slash; `base` is null when the address asks for something that is
 *  not allowed, which `refused` names. */
export type Choice =
  | { readonly base: string; readonly mirror: string | null; readonly refused: null }
  | { readonly base: null; readonly mirror: null; readonly refused: string };

const NEAR = /^http:\/\/(localhost|127\.0\.0\.1):\d+$/;

/** Reads a config of unknown origin; invalid members are left out. */
export function readConfig(body: unknown): Config {
  const { relay, relays, firebase } = fieldsOf(body);
  const isText = (value: unknown): value is string => typeof value === 'string';
  const { databaseURL, apiKey, projectId, emulator } = fieldsOf(firebase);
  return {
    relay: isText(relay) ? relay : null,
    relays: Array.isArray(relays) ? relays.filter(isText) : [],
    accounts:
      isText(apiKey) && isText(projectId)
        ? { apiKey, projectId, emulator: isText(emulator) ? emulator.match(NEAR)?.[0] : undefined }
        : null,
    database: isText(databaseURL) ? databaseURL : null,
  };
}

function fieldsOf(value: unknown): Record<string, unknown> {
  return typeof value === 'object' && value !== null ? (value as Record<string, unknown>) : {};
}

/** Chooses the relay by `home` (the page's folder), `search` (the query of its address) and the config. */
export function chooseRelay(home: string, search: string, config: Config): Choice {
  const query = new URLSearchParams(search);
  const own = addressOf(config.relay, home) ?? home;
  const source = query.get('source');
  const mirror = source === 'firebase' ? addressOf(config.database, home) : null;
  if (source && mirror === null) return { base: null, mirror, refused: `?source=${source}`.slice(0, 80) };
  const asked = query.get('relay');
  if (!asked) return { base: own, mirror, refused: null };
  const wanted = addressOf(asked, home);
  const allowed = [home, own, ...config.relays.map((relay) => addressOf(relay, home))];
  return wanted !== null && allowed.includes(wanted)
    ? { base: wanted, mirror, refused: null }
    : { base: null, mirror: null, refused: (wanted ?? asked).slice(0, 80) };
}

/** Normalises an address to an http(s) folder without query or fragment; null when a page may not read it, for example
 *  because it is unencrypted. */
function addressOf(text: string | null, home: string): string | null {
  if (text === null) return null;
  let url: URL;
  try {
    url = new URL(text.replace(/^ws/, 'http'), home);
  } catch {
    return null;
  }
  const near = url.origin === new URL(home).origin || /^(localhost|127\.0\.0\.1|\[::1\])$/.test(url.hostname);
  if (url.protocol !== 'https:' && !(url.protocol === 'http:' && near)) return null;
  return `${url.origin}${url.pathname.replace(/(?<!\/)\/*$/, '/')}`;
}

const GOOGLE = 'https://identitytoolkit.googleapis.com https://securetoken.googleapis.com';

/** Further hosts that the page talks to, as sources for a Content-Security-Policy. */
export function furtherSources(mirror: string | null, accounts: Accounts | null): string {
  // Firebase databases redirect to a server with another name.
  const database = mirror === null ? '' : `${mirror} https://*.firebaseio.com https://*.firebasedatabase.app`;
  const signIn = accounts === null ? '' : (accounts.emulator ?? GOOGLE);
  return `${database} ${signIn}`;
}
