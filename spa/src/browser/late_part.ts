import { firstPaint } from './first_paint.ts';
import { answers, untilRetry } from './retry.ts';

/** Parts that may be needed later are fetched once the body has stood for this long. */
const AHEAD_AFTER_MS = 2500;

const parts = new Set<LatePart<unknown>>();
let fetching = false;
/** The page's stream is down, so what the page needs may be away too. */
let away = false;

/**
 * A part of the page that is loaded when it is needed, or before (`fetchPartsAhead`). When it can't be fetched it is tried
 * again by itself. Firefox keeps for good that an import failed, the others don't; so after a failure, or while the stream
 * is down, it is not imported before its server answers.
 */
export class LatePart<T> {
  /** Whether it may be fetched before it is asked for. */
  readonly ahead: () => boolean;
  readonly #load: () => Promise<T>;
  readonly #listeners = new Set<() => void>();
  #value: T | null = null;
  #trying: Promise<boolean> | null = null;
  #coming: Promise<T> | null = null;
  #failures = 0;

  constructor(load: () => Promise<T>, ahead: () => boolean = () => true) {
    this.#load = load;
    this.ahead = ahead;
    parts.add(this);
  }

  /** What was loaded; null until it has come. */
  readonly value = (): T | null => this.#value;

  /** Whether somebody waits for it while it did not come, or can't be expected to. */
  readonly failed = (): boolean =>
    this.#coming !== null && this.#value === null && (this.#failures > 0 || away);

  /** Adds a listener for `value` and `failed`. Returns a function that removes it. */
  readonly subscribe = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  /** Resolves when it has come. Never rejects. */
  load(): Promise<T> {
    if (this.#coming === null) {
      this.#coming = this.#keepTrying();
      if (away) queueMicrotask(this.#tell); // without a network some browsers take half a minute to give up
    }
    return this.#coming;
  }

  /** Tries once. Resolves to whether it is here. */
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
    for (const listener of this.#listeners) listener();
  };
}

/** Tells whether the page's stream stands. */
export function setAway(isAway: boolean): void {
  away = isAway;
}

/** Fetches one after the other the parts that may be needed later, in idle moments, so that they are here when the network
 *  is not. Stops at the first that can't be fetched; a later call goes on. Fetches nothing for who saves data. */
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

/** Whether the reader, or a very slow line, asks for nothing that is not needed now. */
export function savesData(): boolean {
  const { connection } = navigator as { connection?: { saveData?: boolean; effectiveType?: string } };
  return connection?.saveData === true || /2g/.test(connection?.effectiveType ?? '');
}

/** Resolves when the browser has nothing else to do. WebKit can't tell; a pause is near enough. */
function idle(): Promise<unknown> {
  return new Promise((resolve) => {
    if ('requestIdleCallback' in window) window.requestIdleCallback(resolve, { timeout: 500 });
    else setTimeout(resolve, 200);
  });
}

/** Style sheets that did not come. */
const lost = new Set<HTMLLinkElement>();
if (typeof document !== 'undefined')
  document.addEventListener(
    'error',
    ({ target }) => target instanceof HTMLLinkElement && target.rel === 'stylesheet' && lost.add(target),
    true,
  );

/** Asks again for style sheets that did not come: Vite asks for each only once. */
function mendStyles(): void {
  for (const link of lost) link.replaceWith(link.cloneNode());
  lost.clear();
}
