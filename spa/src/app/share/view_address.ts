import type { BodyView } from '../../view/body_view.ts';
import { shownMoment } from '../state/moment.ts';
import { presenting } from '../state/presenting.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { selection, selectJoint } from '../state/selection.ts';
import { queryOf, settings } from '../state/settings.ts';
import { readShared, sharedQuery } from './shared_view.ts';

/** How often the address is written. Browsers limit how often a page may do that. */
const EVERY_MS = 500;

/**
 * Keeps the page's address in step with what it shows, so that a copy of the address opens the same view. At first, and
 * when the address changes, the camera and the selected joint are taken from it; a joint that the robot does not have is
 * ignored. Returns a function that stops it.
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
    // 'body' keeps the camera where the address put it
    if (twin.schema.field('pos')?.labels.includes(wanted)) selectJoint(wanted, placed ? 'body' : 'numbers');
    wanted = null;
  };
  const leave = twin.onChange(choose);
  window.addEventListener('hashchange', take);
  take();

  let before = '';
  let known = window.location.hash;
  let stood: number | null = null;
  const write = () => {
    const moment = shownMoment.get();
    if (moment !== null && moment !== stood) {
      stood = moment; // while it moves the address stays as it is
      return;
    }
    stood = moment;
    const { hash } = window.location;
    const isNew = hash !== known; // another link, of which `take` may still have to hear
    known = hash;
    if (isNew || wanted !== null) return;
    const shared = sharedQuery(settings(), {
      joint: selection()?.joint ?? null,
      eye: view.stand,
      momentMs: moment === null ? null : Math.ceil(moment), // so that the shown frame is not after it
    });
    const query = presenting() ? `${shared === '' ? '?' : `${shared}&`}present` : shared;
    const resting = query === before; // written only when nothing has changed since the last check
    before = query;
    const [place = ''] = hash.split('?');
    if (resting && hash !== place + query) {
      window.history.replaceState(window.history.state, '', `${window.location.search}${place}${query}`);
      known = window.location.hash;
    }
  };
  const timer = setInterval(write, EVERY_MS);
  return () => {
    clearInterval(timer);
    window.removeEventListener('hashchange', take);
    leave();
  };
}
