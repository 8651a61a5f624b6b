import type { BodyView } from '../../scene/figure/body_view.ts';
import { onTaps } from '../../scene/figure/taps.ts';
import { more } from '../text/language.ts';

/** The body gives back one finger when none has touched it for this long, ms. */
const IDLE_MS = 10_000;
/** A finger that moves this far to the side wants to turn the body, CSS px. */
const SIDEWAYS_PX = 24;
const HINT_MS = 3000;

/**
 * Lets the page around a frame scroll: one finger and the wheel are that page's, until the viewer takes the body by a tap or a
 * click. Two fingers, the mouse's buttons, and the wheel with Ctrl are always the body's. It gives them back when the mouse leaves
 * it, when something else is pressed, and after ten seconds without a finger. Returns a function that ends this.
 */
export function shareGestures(element: HTMLElement, view: Pick<BodyView, 'setFingers'>): () => void {
  const leave = new AbortController();
  const { signal } = leave;
  let taken = false;
  let idle: ReturnType<typeof setTimeout> | undefined;
  const set = (now: boolean) => {
    clearTimeout(idle);
    taken = now;
    element.dataset.taken = String(now);
    view.setFingers(now ? 'all' : 'two');
  };
  const giveBack = () => set(false);
  const hint = new Hint(element);
  set(false);

  let first: { id: number; x: number; y: number } | null = null;
  const down = (event: PointerEvent) => {
    if (event.pointerType === 'mouse') set(true);
    else clearTimeout(idle);
    first = event.isPrimary ? { id: event.pointerId, x: event.clientX, y: event.clientY } : null;
  };
  const move = (event: PointerEvent) => {
    if (taken || first?.id !== event.pointerId) return;
    const [dx, dy] = [Math.abs(event.clientX - first.x), Math.abs(event.clientY - first.y)];
    if (dx > SIDEWAYS_PX && dx > 2 * dy) hint.show();
  };
  const up = (event: PointerEvent) => {
    first = null;
    if (taken && event.pointerType === 'touch') idle = setTimeout(giveBack, IDLE_MS);
  };
  const wheel = (event: WheelEvent) => {
    if (!taken && !event.ctrlKey) event.stopPropagation();
  };
  // otherwise the browser scrolls with two fingers as with one
  const touch = (event: TouchEvent) => {
    if (event.targetTouches.length > 1 && event.cancelable) event.preventDefault();
  };
  const elsewhere = ({ target }: Event) => {
    if (!element.contains(target as Node)) giveBack();
  };
  element.addEventListener('pointerdown', down, { signal });
  element.addEventListener('pointermove', move, { signal });
  for (const end of ['pointerup', 'pointercancel'] as const) element.addEventListener(end, up, { signal });
  element.addEventListener('pointerleave', (event) => event.pointerType === 'mouse' && giveBack(), {
    signal,
  });
  element.addEventListener('wheel', wheel, { capture: true, signal });
  for (const name of ['touchstart', 'touchmove'] as const)
    element.addEventListener(name, touch, { passive: false, signal });
  window.addEventListener('pointerdown', elsewhere, { signal });
  window.addEventListener('blur', giveBack, { signal });
  const leaveTaps = onTaps(element, () => {
    hint.hide();
    set(true);
    idle = setTimeout(giveBack, IDLE_MS);
  });
  return () => {
    leave.abort();
    leaveTaps();
    hint.hide();
    clearTimeout(idle);
    delete element.dataset.taken;
    view.setFingers('all');
  };
}

/** Says over the body how a finger can turn it. */
class Hint {
  readonly #over: HTMLElement;
  readonly #note = document.createElement('p');
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(over: HTMLElement) {
    this.#over = over;
    this.#note.className = 'guest-hint';
    this.#note.dataset.testid = 'guest-hint';
  }

  show(): void {
    this.#note.textContent = more().tapToTurn;
    this.#over.append(this.#note);
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.hide(), HINT_MS);
  }

  hide(): void {
    clearTimeout(this.#timer);
    this.#note.remove();
  }
}
