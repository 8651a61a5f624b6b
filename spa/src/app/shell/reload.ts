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
