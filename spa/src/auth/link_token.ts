import { asAnyone } from '../relay/as_anyone.ts';
import { setLinkToken } from './token.ts';

const STORE = 'posecast.link';

/** Takes the token out of the address, before anything is asked for: it must not stay in the history, nor travel on when
 *  somebody copies the address. This tab remembers it, so that it can be loaded anew. */
export function takeToken(): void {
  const [page, found] = window.location.hash.split('?t=');
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
