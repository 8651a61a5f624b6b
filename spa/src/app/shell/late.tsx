import { Component, type ComponentType, type ReactNode, useEffect, useSyncExternalStore } from 'react';
import { LatePart } from '../../browser/late_part.ts';
import { firstPaint } from '../../browser/painting.ts';
import { retryNow } from '../../browser/retry.ts';
import { createStore } from '../../kit.ts';
import { signInNeeded } from '../../relay/request.ts';
import { isolated } from '../../twin/names.ts';
import { useStore } from '../state/hooks.ts';
import { say, useText } from '../text/language.ts';

/** A component that is loaded when it is first drawn, or earlier if `ahead` says so. If loading fails, it is counted for
 *  `AbsentNotice` and retried automatically, and the rest of the page still works. */
export function late<P extends object>(
  load: () => Promise<ComponentType<P>>,
  ahead?: () => boolean,
): ComponentType<P> {
  const part = new LatePart(load, ahead);
  return (props: P) => <Arriving part={part} given={props} />;
}

/** The content of a part of the page; null until it has loaded. Loading starts when the component is first drawn. */
export function useLatePart<T>(part: LatePart<T>): T | null {
  useEffect(() => {
    void part.load();
  }, [part]);
  return useSyncExternalStore(part.subscribe, part.value);
}

function Arriving<P extends object>({ part, given }: { part: LatePart<ComponentType<P>>; given: P }) {
  const Loaded = useLatePart(part);
  const failed = useSyncExternalStore(part.subscribe, part.failed);
  if (Loaded !== null) return <Loaded {...given} />;
  return failed ? <NotHere /> : null;
}

/** Like `late`, but loading waits until the body was first drawn, or 2 s: on a slow connection the body comes first. */
export function lateAfterBody<P extends object>(load: () => Promise<ComponentType<P>>): ComponentType<P> {
  return late(() => firstPaint().then(load));
}

/** For parts that are loaded only on demand: other pages, and rarely needed parts. */
export const onDemand = (): boolean => false;

/** How many parts that should be on the page could not be loaded. */
const absent = createStore(0);

function NotHere() {
  useEffect(() => {
    absent.set(absent.get() + 1);
    return () => absent.set(absent.get() - 1);
  }, []);
  return null;
}

/** A row with a reload button, if the site wants people to sign in again, or parts of the page could not be loaded. */
export function AbsentNotice() {
  const text = useText();
  const isSignIn = useStore(signInNeeded);
  if (useStore(absent) === 0 && !isSignIn) return null;
  return (
    <p className="drop-notice" role="alert" data-testid={isSignIn ? 'sign-in-needed' : 'not-here'}>
      <span>{isSignIn ? text.signInNeeded : text.tryingAgain(text.notHere)}</span>
      {!isSignIn && (
        <button type="button" className="text-button" onClick={retryNow}>
          {text.tryNow}
        </button>
      )}
      <button type="button" className="text-button" onClick={() => window.location.reload()}>
        {text.reload}
      </button>
    </p>
  );
}

/** Starts something when its chunk has loaded: `code` resolves to the function that starts it, which returns the function
 *  that stops it. If loading fails, nothing is started. Returns a function that stops it, or keeps it from starting. */
export function startWhenLoaded(code: Promise<() => () => void>): () => void {
  let left = false;
  let end: (() => void) | null = null;
  code.then(
    (begin) => {
      if (!left) end = begin();
    },
    () => {},
  );
  return () => {
    left = true;
    end?.();
  };
}

/** Shows an error message with a reload button instead of its children when rendering them throws. */
export class ErrorBoundary extends Component<{ children: ReactNode }, { what: string | null }> {
  override state: { what: string | null } = { what: null };

  static getDerivedStateFromError(error: unknown): { what: string } {
    return { what: isolated(error instanceof Error ? error.message : String(error)) };
  }

  override render(): ReactNode {
    if (this.state.what === null) return this.props.children;
    return (
      <main className="broken" role="alert">
        <h1>{say().stopped}</h1>
        <p>{say().stoppedWhy(this.state.what)}</p>
        <button type="button" className="text-button" onClick={() => window.location.reload()}>
          {say().reload}
        </button>
      </main>
    );
  }
}

/** A page that was reloaded less than this long ago is not reloaded again. */
const YOUNG_MS = 60_000;

/**
 * Reloads the page after a deploy: a page that was open before it asks for chunks that no longer exist. When a chunk
 * can't be loaded, `reloadIfReplaced` finds out whether that is the reason.
 */
export function reloadAfterDeploy(): void {
  window.addEventListener('vite:preloadError', () => void reloadIfReplaced());
}

/** Reloads the page if the page at its address now names other scripts. Does nothing if that page can't be fetched, or
 *  within a minute of a reload. */
export async function reloadIfReplaced(): Promise<void> {
  const [navigation] = performance.getEntriesByType('navigation') as PerformanceNavigationTiming[];
  if (navigation?.type === 'reload' && performance.now() < YOUNG_MS) return;
  try {
    const answer = await fetch(window.location.href.replace(/[?#].*$/, ''), { cache: 'no-cache' });
    const page = await answer.text();
    const scripts = [...document.querySelectorAll<HTMLScriptElement>('script[type=module][src]')];
    const same = scripts.every(({ src }) => page.includes(src.slice(src.lastIndexOf('/'))));
    // a redirect may lead to a proxy's sign-in page
    if (answer.ok && !answer.redirected && !same) window.location.reload();
  } catch {
    // no network
  }
}
