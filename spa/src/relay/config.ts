/** What a `config.json` beside the page says, and which relay or mirror an address may therefore name. */

/** A Firebase project, by its names in the Firebase console. */
export interface Accounts {
  readonly apiKey: string;
  readonly projectId: string;
  /** The Auth emulator, on this computer only. */
  readonly emulator: string | undefined;
}

/** What lies beside the page in `config.json`. */
export interface Config {
  /** The relay to read unless the address says otherwise; null: the page's own origin. */
  readonly relay: string | null;
  /** Further ones that `?relay=` may name. */
  readonly relays: readonly string[];
  /** Who signs people in; null: nobody. */
  readonly accounts: Accounts | null;
  /** A mirror in a Firebase Realtime Database, which `?source=firebase` reads. */
  readonly database: string | null;
}

/** `base` ends with a slash, as does `mirror`; null when what the address asks for is not allowed, which `refused` names. */
export type Choice =
  | { readonly base: string; readonly mirror: string | null; readonly refused: null }
  | { readonly base: null; readonly mirror: null; readonly refused: string };

const NEAR = /^http:\/\/(localhost|127\.0\.0\.1):\d+$/;

/** Whatever stands there: what is odd is left out. */
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

/** @param home the page's folder, @param search of its address */
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

/** In one spelling: http or https, a folder, nothing behind it. Null: none that a page may read, for it is in the clear. */
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

/** Whom a page talks to beside its relay, as a content policy names them. */
export function furtherSources(mirror: string | null, accounts: Accounts | null): string {
  // Google's databases send one on to a server of another name.
  const database = mirror === null ? '' : `${mirror} https://*.firebaseio.com https://*.firebasedatabase.app`;
  const signIn = accounts === null ? '' : (accounts.emulator ?? GOOGLE);
  return `${database} ${signIn}`;
}
