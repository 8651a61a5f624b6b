import { Emitter } from '../kit.ts';
import { firstPaint } from './painting.ts';
import { answers, untilRetry } from './retry.ts';

/** Parts that may be needed later are fetched once the body has been shown for this long. */
const AHEAD_AFTER_MS = 2500;

const parts = new Set<LatePart<unknown>>();
let fetching = false;
/** Whether the page's stream is down; if so, the server with the chunks may be unreachable too. */
let away = false;

/**
 * A part of the page that is loaded when it is needed, or earlier (`fetchPartsAhead`). A failed load is retried automatically.
 * Firefox caches a failed import forever, other browsers don't; so after a failure, or while the stream is down, the part is
 * imported only once its server answers.
 */
export class LatePart<T> {
  /** Whether it may be fetched before it is needed. */
  readonly ahead: () => boolean;
  readonly #load: () => Promise<T>;
  readonly #changed = new Emitter();
  #value: T | null = null;
  #trying: Promise<boolean> | null = null;
  #coming: Promise<T> | null = null;
  #failures = 0;

  constructor(load: () => Promise<T>, ahead: () => boolean = () => true) {
    this.#load = load;
    this.ahead = ahead;
    parts.add(this);
  }

  /** The loaded module; null until it has loaded. */
  readonly value = (): T | null => this.#value;

  /** Whether somebody is waiting for it after a failed load, or while the server is unreachable. */
  readonly failed = (): boolean =>
    this.#coming !== null && this.#value === null && (this.#failures > 0 || away);

  /** Adds a listener for `value` and `failed`. Returns a function that removes it. */
  readonly subscribe = this.#changed.on;

  /** Resolves when it has loaded. Never rejects. */
  load(): Promise<T> {
    if (this.#coming === null) {
      this.#coming = this.#keepTrying();
      if (away) queueMicrotask(this.#tell); // without a network, some browsers take half a minute to give up
    }
    return this.#coming;
  }

  /** Tries once. Resolves to whether it has loaded. */
  attempt(): Promise<boolean> {
    this.#trying ??= this.#try().finally(() => {
      this.#trying = null;
    });
    return this.#trying;
  }

  async #keepTrying(): Promise<T> {
    while (!(await this.attempt())) await untilRetry(this.#failures);
    return this.#value as T;
  }

  async #try(): Promise<boolean> {
    if (this.#value !== null) return true;
    try {
      if (this.#failures > 0 || away) {
        if (!(await answers(document.baseURI))) throw new Error('no answer');
        mendStyles();
      }
      this.#value = await this.#load();
    } catch {
      this.#failures += 1;
    }
    this.#tell();
    return this.#value !== null;
  }

  readonly #tell = (): void => {
    this.#changed.emit();
  };
}

/** Reports whether the page's stream is up. */
export function setAway(isAway: boolean): void {
  away = isAway;
}

/** Fetches the parts that may be needed later, one by one in idle time, so that they are available without a network. Stops at
 *  the first failure; a later call continues. Fetches nothing if the viewer's browser saves data. */
export async function fetchPartsAhead(): Promise<void> {
  if (fetching || savesData()) return;
  fetching = true;
  await firstPaint();
  await new Promise((resolve) => setTimeout(resolve, AHEAD_AFTER_MS));
  for (const part of parts) {
    if (part.value() !== null || !part.ahead()) continue;
    await idle();
    if (away || !(await part.attempt())) break;
  }
  fetching = false;
}

/** Whether the viewer's settings, or a very slow connection, rule out optional downloads. */
export function savesData(): boolean {
  const { connection } = navigator as { connection?: { saveData?: boolean; effectiveType?: string } };
  return connection?.saveData === true || /2g/.test(connection?.effectiveType ?? '');
}

/** Resolves when the browser is idle. WebKit can't tell, so a pause is used instead. */
function idle(): Promise<unknown> {
  return new Promise((resolve) => {
    if ('requestIdleCallback' in window) window.requestIdleCallback(resolve, { timeout: 500 });
    else setTimeout(resolve, 200);
  });
}

/** Style sheets that failed to load. */
const lost = new Set<HTMLLinkElement>();
let lostOnes = 0;

/** Requests a style sheet again after a while. */
async function mendLater(link: HTMLLinkElement): Promise<void> {
  lost.add(link);
  lostOnes += 1;
  await untilRetry(lostOnes);
  if (lost.delete(link)) link.replaceWith(link.cloneNode());
}

/** Whether a style sheet has come. If it has not, some browsers have none, others one that can't be read. */
function isLoaded({ sheet }: HTMLLinkElement): boolean {
  try {
    return sheet !== null && sheet.cssRules.length > 0;
  } catch {
    return false;
  }
}

if (typeof document !== 'undefined') {
  // those of the page itself fail before this script runs
  for (const link of document.querySelectorAll<HTMLLinkElement>('link[rel=stylesheet]'))
    if (!isLoaded(link)) void mendLater(link);
  document.addEventListener(
    'error',
    ({ target }) =>
      target instanceof HTMLLinkElement && target.rel === 'stylesheet' && void mendLater(target),
    true,
  );
}

/** Requests style sheets that failed to load again, now: Vite requests each only once. */
function mendStyles(): void {
  for (const link of lost) link.replaceWith(link.cloneNode());
  lost.clear();
}
