import type { BodyView } from '../../../view/body_view.ts';
import { onTaps } from '../../../view/taps.ts';
import { onSettings, settings } from '../../state/settings.ts';
import { onLanguage } from '../../text/language.ts';
import { more } from '../../text/more.ts';

/** How far one key press turns, moves and zooms the camera. */
const TURN_RAD = Math.PI / 24;
const PAN_PX = 40;
const NEARER = 0.85;

const ARROWS: ReadonlyMap<string, readonly [x: number, y: number]> = new Map([
  ['ArrowLeft', [1, 0]],
  ['ArrowRight', [-1, 0]],
  ['ArrowUp', [0, 1]],
  ['ArrowDown', [0, -1]],
]);

type Eye = Pick<BodyView, 'look' | 'focus' | 'orbit' | 'pan' | 'zoom' | 'pick'>;

/** The camera's keyboard shortcuts in display order, each with the key of its description in `moreEn`. */
export const CAMERA_KEYS = [
  ['← → ↑ ↓', 'keyTurn'],
  ['Shift', 'keyMove'],
  ['+ −', 'keyNearer'],
  ['1 2 3', 'keyViews'],
  ['0', 'keyFirst'],
  ['C', 'keyClose'],
] as const;

/** Handles a key of the camera; false if the camera has no such key. `middle` is the middle of the body's element in the
 *  window, CSS px. */
export function playKey(
  view: Eye,
  event: Pick<KeyboardEvent, 'key' | 'shiftKey'>,
  middle: { x: number; y: number },
): boolean {
  const arrow = ARROWS.get(event.key);
  if (arrow !== undefined) {
    const [x, y] = arrow;
    if (event.shiftKey) view.pan(x * PAN_PX, y * PAN_PX);
    else view.orbit(x * TURN_RAD, y * TURN_RAD);
    return true;
  }
  switch (event.key) {
    case '+':
    case '=':
      view.zoom(NEARER);
      return true;
    case '-':
      view.zoom(1 / NEARER);
      return true;
    case '0':
      view.look('home');
      return true;
    case '1':
      view.look('front');
      return true;
    case '2':
      view.look('side');
      return true;
    case '3':
      view.look('top');
      return true;
    case 'c':
    case 'C':
      closeTo(view, middle);
      return true;
    default:
      return false;
  }
}

/** Moves close to the link at a point of the window (CSS px), or back to the home view if there is no link. */
export function closeTo(view: Pick<Eye, 'pick' | 'focus' | 'look'>, at: { x: number; y: number }): void {
  const link = view.pick(at.x, at.y);
  if (link === null) view.look('home');
  else view.focus(link);
}

/** Attaches keys, double taps and the chosen mouse style to the body's element. Keys work while nothing else on the page has the
 *  focus. Returns a function that detaches them. */
export function attachCameraControls(element: HTMLElement, view: BodyView): () => void {
  const chosen = () => {
    const { mouse, follow } = settings();
    view.setMouse(mouse);
    view.setFollow(follow);
  };
  const onKey = (event: KeyboardEvent) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    const { activeElement } = document;
    if (activeElement !== null && activeElement !== document.body && !element.contains(activeElement)) return;
    const { left, top, width, height } = element.getBoundingClientRect();
    if (playKey(view, event, { x: left + width / 2, y: top + height / 2 })) event.preventDefault();
  };
  // for screen readers, because a canvas has no text
  const named = () => element.querySelector('canvas')?.setAttribute('aria-label', more().viewOfRobot);
  chosen();
  named();
  window.addEventListener('keydown', onKey);
  const leave = [
    onLanguage(named),
    onSettings(chosen),
    onTaps(element, (x, y, times) => times === 2 && closeTo(view, { x, y })),
  ];
  return () => {
    window.removeEventListener('keydown', onKey);
    for (const off of leave) off();
  };
}
