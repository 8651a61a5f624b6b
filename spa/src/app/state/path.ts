/**
 * A relay serves the page also at `/r/demo`, and with status 404 at whatever somebody has mistyped. It says in the root
 * element how many folders above the page's files are (`data-home`). All else in the page knows hashes only.
 */

/** The hash of what a path below the page's folder names: of `r/demo`, `#/r/demo`. */
export function hashOfPath(path: string): string {
  return `#/${path.replace(/%2b/gi, '+')}`;
}

let named: string | null = null;

/** Writes what the path names into an empty hash. Called before anything reads the hash. */
export function adoptPath(): void {
  const { dataset } = document.documentElement;
  if (dataset.home === undefined || dataset.page === 'embed') return;
  const home = new URL(dataset.home, window.location.href);
  dataset.home = home.href; // stays true when the path changes
  named = hashOfPath(window.location.pathname.slice(home.pathname.length));
  if (window.location.hash.length < 2) window.history.replaceState(window.history.state, '', named);
}

/** Goes to the page's own path as soon as the hash names something else than the path, so that a copy of the address
 *  says one thing. Called when the page's files are asked for already: their addresses are relative to the path. */
export function leavePath(): void {
  const { search, hash } = window.location;
  if (named === null || hash.split('?')[0] === named) return;
  window.history.replaceState(
    window.history.state,
    '',
    `${document.documentElement.dataset.home}${search}${hash}`,
  );
}
