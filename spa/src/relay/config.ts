import { fieldsOf } from '../kit.ts';

/** Reads the `config.json` beside the page, and decides which relay or mirror an address may select. */

/** A Firebase project, by its names in the Firebase console. */
export interface Accounts {
  readonly apiKey: string;
  readonly projectId: string;
  /** Address of a Firebase Auth emulator on this computer, for development. */
  readonly emulator: string | undefined;
}

/** The contents of the `config.json` beside the page. */
export interface Config {
  /** The relay to read unless the address names another; null: the page's own origin. */
  readonly relay: string | null;
  /** Further relays that `?relay=` may name. */
  readonly relays: readonly string[];
  /** The address at which `relay` is read through a cache, by viewers without a token; null: none. */
  readonly lane: string | null;
  /** The Firebase project in which people sign in; null: no accounts. */
  readonly accounts: Accounts | null;
  /** Address of a mirror in a Firebase Realtime Database, for `?source=firebase`. */
  readonly database: string | null;
}

/** The selected relay. `base`, `mirror` and `lane` end with a slash; `base` is null if the address requests something that is not
 *  allowed, which `refused` names. `lane`: where viewers without a token read segments instead of the relay's socket; null:
 *  everybody uses a socket. */
export type Choice =
  | {
      readonly base: string;
      readonly mirror: string | null;
      readonly lane: string | null;
      readonly refused: null;
    }
  | { readonly base: null; readonly mirror: null; readonly lane: null; readonly refused: string };

const NEAR = /^http:\/\/(localhost|127\.0\.0\.1):\d+$/;

/** Reads an untrusted config; invalid members are left out. */
export function readConfig(body: unknown): Config {
  const { relay, relays, lane, firebase } = fieldsOf(body);
  const isText = (value: unknown): value is string => typeof value === 'string';
  const { databaseURL, apiKey, projectId, emulator } = fieldsOf(firebase);
  return {
    relay: isText(relay) ? relay : null,
    relays: Array.isArray(relays) ? relays.filter(isText) : [],
    lane: isText(lane) ? lane : null,
    accounts:
      isText(apiKey) && isText(projectId)
        ? { apiKey, projectId, emulator: isText(emulator) ? emulator.match(NEAR)?.[0] : undefined }
        : null,
    database: isText(databaseURL) ? databaseURL : null,
  };
}

/** Selects the relay from `home` (the page's folder), `search` (the query of its address) and the config. */
export function chooseRelay(home: string, search: string, config: Config): Choice {
  const query = new URLSearchParams(search);
  const own = addressOf(config.relay, home) ?? home;
  const source = query.get('source');
  const mirror = source === 'firebase' ? addressOf(config.database, home) : null;
  if (source && mirror === null) return refusal(`?source=${source}`);
  const asked = query.get('relay');
  const wanted = asked ? addressOf(asked, home) : own;
  const allowed = [home, own, ...config.relays.map((relay) => addressOf(relay, home))];
  if (wanted === null || !allowed.includes(wanted)) return refusal(wanted ?? asked ?? '');
  // The config's lane belongs to the config's relay. Any other value of `?lane=` is ignored: it selects a way to read, not a
  // robot.
  const cached = wanted === own ? addressOf(config.lane, home) : null;
  const lane = cached ?? (query.get('lane') === 'segments' ? wanted : null);
  return { base: wanted, mirror, lane: mirror === null ? lane : null, refused: null };
}

function refusal(asked: string): Choice {
  return { base: null, mirror: null, lane: null, refused: asked.slice(0, 80) };
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

/** Additional hosts that the page contacts, as sources for a Content-Security-Policy. */
export function furtherSources({ mirror, lane }: Choice, accounts: Accounts | null): string {
  // Firebase databases redirect to a server with another name.
  const database = mirror === null ? '' : `${mirror} https://*.firebaseio.com https://*.firebasedatabase.app`;
  const signIn = accounts === null ? '' : (accounts.emulator ?? GOOGLE);
  const cache = lane === null ? '' : new URL(lane).origin;
  return `${database} ${signIn} ${cache}`;
}
