import { type ComponentType, type LazyExoticComponent, lazy } from 'react';
import { firstPaint } from '../../browser/first_paint.ts';
import { useText } from '../text/language.ts';

/** A component that is loaded on demand. If loading fails, the rest of the page still works. */
export function late<P extends object>(
  load: () => Promise<ComponentType<P>>,
): LazyExoticComponent<ComponentType<P>> {
  return lazy(async () => ({ default: await load().catch(() => NotHere) }));
}

/** The same, but not before the body: on a slow line that comes first. */
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
