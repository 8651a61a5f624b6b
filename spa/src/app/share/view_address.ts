import type { BodyView } from '../../scene/figure/body_view.ts';
import { shownMoment } from '../state/moment.ts';
import { presenting } from '../state/presenting.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { selection, selectJoint } from '../state/selection.ts';
import { queryOf, settings } from '../state/settings.ts';
import { readShared, sharedQuery } from './shared_view.ts';

/** How often the page checks whether the address is up to date. */
const EVERY_MS = 500;
/** Approximate interval between two updates while the past plays: browsers allow a page 100 in 30 s. */
const PLAYED_EVERY_MS = 900;

/**
 * Keeps the page's address in step with what it shows, so that a copy of the address opens the same view. At first, and when the
 * address changes, the camera and the selected joint are taken from it; an unknown joint is ignored. Returns a function that
 * stops it.
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
  let wroteMs = Number.NEGATIVE_INFINITY;
  const write = () => {
    const moment = shownMoment.get();
    const { hash } = window.location;
    const isNew = hash !== known; // another link, which `take` may not have received yet
    known = hash;
    if (isNew || wanted !== null) return;
    const shared = sharedQuery(settings(), {
      joint: selection()?.joint ?? null,
      eye: view.stand,
      momentMs: moment,
    });
    const query = presenting() ? `${shared === '' ? '?' : `${shared}&`}present` : shared;
    // Written only if nothing has changed since the last check, except for a moment that is playing, which is written now and
    // then.
    const nowMs = performance.now();
    const due = query === before || (moment !== null && nowMs - wroteMs >= PLAYED_EVERY_MS);
    before = query;
    const place = hash.split('?')[0] || '#/'; // for a recording, which needs none
    if (due && hash !== place + query) {
      wroteMs = nowMs;
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
