import { type ComponentType, type LazyExoticComponent, lazy } from 'react';
import { firstPaint } from '../../browser/first_paint.ts';
import { useText } from '../text/language.ts';

/** A component that is loaded when it is first drawn, so it needs a `Suspense` around it. If loading fails, it shows a
 *  note with a reload button and the rest of the page still works. */
export function late<P extends object>(
  load: () => Promise<ComponentType<P>>,
): LazyExoticComponent<ComponentType<P>> {
  return lazy(async () => ({ default: await load().catch(() => NotHere) }));
}

/** Like `late`, but loading waits until the body was first drawn, or 2 s: on a slow connection the body comes first. */
export function lateAfterBody<P extends object>(
  load: () => Promise<ComponentType<P>>,
): LazyExoticComponent<ComponentType<P>> {
  return late(() => firstPaint.then(load));
}

function NotHere() {
  const text = useText();
  return (
    <p className="drop-notice" role="alert" data-testid="not-here">
      <span>{text.notHere}</span>
      <button type="button" className="text-button" onClick={() => window.location.reload()}>
        {text.reload}
      </button>
    </p>
  );
}
