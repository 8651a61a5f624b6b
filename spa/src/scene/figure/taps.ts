const TAP_MS = 300;
const BETWEEN_MS = 350;
/** How far a finger may move during a tap, or between two taps. */
const NEAR_PX = 24;

interface Tap {
  readonly x: number;
  readonly y: number;
  readonly ms: number;
}

/** Reports taps of one finger and left clicks at once; `times` is 2 for the second of two quick taps at one place. It replaces
 *  `dblclick`, which not every touch screen sends. Returns a function that stops it. */
export function onTaps(
  element: HTMLElement,
  tapped: (clientX: number, clientY: number, times: 1 | 2) => void,
): () => void {
  let down: Tap | null = null;
  let first: Tap | null = null;
  const near = (a: Tap, b: Tap) => Math.hypot(a.x - b.x, a.y - b.y) <= NEAR_PX;
  const press = (event: PointerEvent) => {
    // a second finger makes it a different gesture
    down = event.isPrimary && event.button === 0 ? tapOf(event) : null;
    if (down === null) first = null;
  };
  const lift = (event: PointerEvent) => {
    const now = tapOf(event);
    const isTap = down !== null && event.isPrimary && now.ms - down.ms <= TAP_MS && near(down, now);
    down = null;
    if (!isTap) {
      first = null;
      return;
    }
    const again = first !== null && now.ms - first.ms <= BETWEEN_MS && near(first, now);
    first = again ? null : now;
    tapped(now.x, now.y, again ? 2 : 1);
  };
  element.addEventListener('pointerdown', press);
  element.addEventListener('pointerup', lift);
  return () => {
    element.removeEventListener('pointerdown', press);
    element.removeEventListener('pointerup', lift);
  };
}

const tapOf = (event: PointerEvent): Tap => ({ x: event.clientX, y: event.clientY, ms: event.timeStamp });
