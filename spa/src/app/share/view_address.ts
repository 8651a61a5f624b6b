import type { BodyView } from '../../view/body_view.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { selection, selectJoint } from '../state/selection.ts';
import { queryOf, settings } from '../state/settings.ts';
import { readShared, sharedQuery } from './shared_view.ts';

/** Often enough for whoever copies the address, seldom enough for browsers that count. */
const EVERY_MS = 500;

/**
 * Keeps the address in step with what the page shows, so that any copy of it opens the same. First the page takes what
 * the address says. What is named but does not exist is left out. Returns the end of it.
 */
export function bindAddress(view: BodyView, { twin }: RobotLink): () => void {
  let wanted: string | null = null;
  let placed = false;
  const take = () => {
    const { joint, eye } = readShared(queryOf(window.location.hash));
    placed = eye !== null;
    if (eye !== null) view.standAt(eye);
    wanted = joint;
    choose();
  };
  const choose = () => {
    if (wanted === null || twin.schema === null) return;
    if (twin.schema.field('pos')?.labels.includes(wanted)) selectJoint(wanted, placed ? 'body' : 'numbers'); // the camera has its place
    wanted = null;
  };
  const leave = twin.onChange(choose);
  window.addEventListener('hashchange', take);
  take();

  let before = '';
  const write = () => {
    if (wanted !== null) return;
    const query = sharedQuery(settings(), { joint: selection()?.joint ?? null, eye: view.stand });
    const resting = query === before; // what still moves is not written
    before = query;
    const [place = ''] = window.location.hash.split('?');
    if (resting && window.location.hash !== place + query) {
      window.history.replaceState(window.history.state, '', `${window.location.search}${place}${query}`);
    }
  };
  const timer = setInterval(write, EVERY_MS);
  return () => {
    clearInterval(timer);
    window.removeEventListener('hashchange', take);
    leave();
  };
}
