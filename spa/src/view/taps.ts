const TAP_MS = 300;
const BETWEEN_MS = 350;
/** A finger is not a point. */
const NEAR_PX = 24;

interface Tap {
  readonly x: number;
  readonly y: number;
  readonly ms: number;
}

/** Taps and clicks (left button) of one finger: each is told at once, with 2 when it is the second of two quick ones at
 *  one place; `dblclick` does not come from every touch screen. Returns the end of it. */
export function onTaps(
  element: HTMLElement,
  tapped: (clientX: number, clientY: number, times: 1 | 2) => void,
): () => void {
  let down: Tap | null = null;
  let first: Tap | null = null;
  const near = (a: Tap, b: Tap) => Math.hypot(a.x - b.x, a.y - b.y) <= NEAR_PX;
  const press = (event: PointerEvent) => {
    // a second finger makes it another gesture
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
