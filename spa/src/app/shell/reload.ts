/** A page that was itself just loaded anew is not loaded anew once more. */
const YOUNG_MS = 60_000;

/**
 * After a deploy a page that stood open asks for chunks that are gone. When that happens and the page at this address
 * has become another, it is loaded anew, once. A network that is down is no deploy: then the page stays as it is.
 */
export function reloadAfterDeploy(): void {
  window.addEventListener('vite:preloadError', () => void reloadIfReplaced());
}

export async function reloadIfReplaced(): Promise<void> {
  const [navigation] = performance.getEntriesByType('navigation') as PerformanceNavigationTiming[];
  if (navigation?.type === 'reload' && performance.now() < YOUNG_MS) return;
  try {
    const answer = await fetch(window.location.href.replace(/[?#].*$/, ''), { cache: 'no-cache' });
    const page = await answer.text();
    const scripts = [...document.querySelectorAll<HTMLScriptElement>('script[type=module][src]')];
    const same = scripts.every(({ src }) => page.includes(src.slice(src.lastIndexOf('/'))));
    if (answer.ok && !same) window.location.reload();
  } catch {
    // no network
  }
}
