import { createStore } from '../../kit.ts';
import { queryOf } from './settings.ts';
import { useStore } from './use_store.ts';

const named = () => queryOf(window.location.hash).has('present');

/** Whether the page is shown as for a projector. A link with `present` in its query opens so. */
const inForce = createStore(typeof window !== 'undefined' && named());

/** Whether the page is shown as for a projector. */
export const presenting = inForce.get;
/** Begins or ends presenting. */
export const present = inForce.set;

/** Follows links to and from pages that are to be presented. Returns a function that stops it. */
export function followPresentLinks(): () => void {
  const follow = () => present(named());
  follow();
  window.addEventListener('hashchange', follow);
  return () => window.removeEventListener('hashchange', follow);
}

/** Whether the page is shown as for a projector. The component is drawn again when that changes. */
export function usePresenting(): boolean {
  return useStore(inForce);
}
