import { asAnyone, setLinkToken } from './token.ts';

const STORE = 'posecast.link';
/** `t` may also be a moment, which is a date, or garbage: a token has its robot between dots. */
const MOMENT = /^\d{4}-\d\d-\d\dT/;

/** Removes a share link's token from the address before any request, so that it appears neither in the history nor in a copied
 *  address. It is kept in the tab's storage, so that a reload works. */
export function takeToken(): void {
  const [page, named] = window.location.hash.split('?t=');
  const found = named?.includes('.') && !MOMENT.test(named) ? named : undefined;
  try {
    if (found) sessionStorage.setItem(STORE, found);
    hold(found ?? sessionStorage.getItem(STORE) ?? '');
  } catch {
    hold(found ?? ''); // no storage here
  }
  if (found) history.replaceState(history.state, '', page);
}

function hold(token: string): void {
  setLinkToken(asAnyone() ? '' : token);
}
