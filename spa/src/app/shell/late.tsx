import { type ComponentType, useEffect, useSyncExternalStore } from 'react';
import { LatePart } from '../../browser/late_part.ts';
import { firstPaint } from '../../browser/painting.ts';
import { retryNow } from '../../browser/retry.ts';
import { createStore } from '../../kit.ts';
import { signInNeeded } from '../../relay/request.ts';
import { useStore } from '../state/use_store.ts';
import { useText } from '../text/language.ts';

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
  const Loaded = useSyncExternalStore(part.subscribe, part.value);
  const failed = useSyncExternalStore(part.subscribe, part.failed);
  if (Loaded !== null) return <Loaded {...given} />;
  void part.load();
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
