import type { PastControls } from '../../../past/past_types.ts';
import { isGuest } from '../../state/address.ts';
import { stepScale } from './line.ts';

/** The amount of scrolling or swiping that changes the scale by one step, CSS px. */
const NOTCH_PX = 60;
/** A single swipe changes it at most this often, ms. */
const APART_MS = 220;
/** A swipe with a pause this long is over, ms. */
const REST_MS = 400;
const LINE_PX = 20;
/** Two fingers that spread or pinch by this factor change it by one step. */
const FACTOR = 1.5;

/** Changes the scale of a line with the wheel over it, or with two fingers on it. Returns a function that ends this. */
export function listenToGestures(element: HTMLElement, controls: PastControls): () => void {
  const onStep = (by: 1 | -1) => stepScale(controls, by);
  const ends = [listenToWheel(element, onStep), listenToPinch(element, controls, onStep)];
  return () => {
    for (const end of ends) end();
  };
}

function listenToWheel(element: HTMLElement, onStep: (by: 1 | -1) => void): () => void {
  let [sum, movedMs, steppedMs] = [0, 0, 0];
  const wheel = (event: WheelEvent) => {
    if (Math.abs(event.deltaY) < Math.abs(event.deltaX) || (isGuest() && !event.ctrlKey)) return;
    event.preventDefault(); // with Ctrl, or with two fingers, the page would zoom
    const { timeStamp } = event;
    if (timeStamp - movedMs > REST_MS) sum = 0;
    movedMs = timeStamp;
    // two fingers on a trackpad report small numbers
    sum += event.deltaY * (event.deltaMode === 0 ? (event.ctrlKey ? 8 : 1) : LINE_PX);
    if (Math.abs(sum) < NOTCH_PX || timeStamp - steppedMs < APART_MS) return;
    steppedMs = timeStamp;
    onStep(sum > 0 ? 1 : -1);
    sum = 0;
  };
  element.addEventListener('wheel', wheel, { passive: false });
  return () => element.removeEventListener('wheel', wheel);
}

/** The first finger has already moved the playhead when the second one touches: that is undone. */
function listenToPinch(
  element: HTMLElement,
  controls: PastControls,
  onStep: (by: 1 | -1) => void,
): () => void {
  const fingers = new Map<number, { x: number; y: number }>();
  let before = controls.playhead;
  let apartPx: number | null = null;
  const distance = () => {
    const [a, b] = [...fingers.values()];
    return a === undefined || b === undefined ? 0 : Math.max(20, Math.hypot(a.x - b.x, a.y - b.y));
  };
  const down = (event: PointerEvent) => {
    if (event.pointerType !== 'touch' || fingers.size === 2) return;
    if (fingers.size === 0) before = controls.playhead;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (fingers.size < 2) return;
    event.stopPropagation();
    const [first] = fingers.keys();
    const given = { bubbles: true, pointerId: first!, pointerType: 'touch' };
    event.target?.dispatchEvent(new PointerEvent('pointercancel', given));
    if (before.at === 'live') controls.goLive();
    else controls.seek(before.momentMs);
    apartPx = distance();
  };
  const move = (event: PointerEvent) => {
    if (!fingers.has(event.pointerId)) return;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (apartPx === null) return;
    event.stopPropagation();
    const factor = distance() / apartPx;
    if (factor < FACTOR && factor > 1 / FACTOR) return;
    apartPx *= factor;
    onStep(factor > 1 ? -1 : 1);
  };
  const up = (event: PointerEvent) => {
    if (!event.isTrusted && event.type === 'pointercancel') return; // its own
    if (!fingers.delete(event.pointerId) || apartPx === null) return;
    event.stopPropagation();
    if (fingers.size === 0) apartPx = null;
  };
  const heard = [
    ['pointerdown', down],
    ['pointermove', move],
    ['pointerup', up],
    ['pointercancel', up],
  ] as const;
  for (const [name, run] of heard) element.addEventListener(name, run, true);
  return () => {
    for (const [name, run] of heard) element.removeEventListener(name, run, true);
  };
}
