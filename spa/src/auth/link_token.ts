import { asAnyone } from '../relay/as_anyone.ts';
import { setLinkToken } from './token.ts';

const STORE = 'posecast.link';
/** `t` may also name a moment, which is a date, or nonsense: a token has its robot between dots. */
const MOMENT = /^\d{4}-\d\d-\d\dT/;

/** Takes a share link's token out of the address before any request, so that it does not stay in the history or in a
 *  copied address. The tab keeps it in its storage, so that a reload works. */
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
