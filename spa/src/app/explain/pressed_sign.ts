import { type Line, recentLines, type Spot } from '../../browser/drawn_lines.ts';

/** The furthest a pointer may move between press and release to count as a tap, CSS px. */
const TAP_PX = { mouse: 6, touch: 10 };
/** A press this near (CSS px) hits a sign's line, even where the body is drawn behind it, because lines are drawn on top. */
const ON_PX = 10;
/** A press this near hits a sign if no body is under it: arrows move, and fingers are wide. */
const BESIDE_PX = { mouse: 24, touch: 44 };

/** Elements over the body that have an explanation but let pointers through, so that they don't block the camera. */
const OVER_BODY = '.sign-label:not([hidden]), .stage-level:not([hidden])';

/** Labels whose lines also open the explanation. A joint's deviation is excluded: it lies on the joint, and a tap there selects
 *  the joint. */
const ARROW_LABEL = '.sign-label:not([data-sign*="apart-"])';

/** Elements over the picture that handle presses themselves. */
const CONTROLS = 'button, a, input, select, label, summary';

interface Press extends Spot {
  readonly by: keyof typeof TAP_PX;
  readonly label: HTMLElement | null;
}

let newest: Press | null = null;

/**
 * Finds out at each press what it hits, because an arrow may have moved by the release. The first match wins, in this order: a
 * label or the spirit level under the press, an arrow's line, the body (`bodyAt`, called with window CSS px), the nearest arrow
 * beside it. Returns a function that stops it.
 */
export function watchPresses(bodyAt: (x: number, y: number) => boolean): () => void {
  const onPress = (event: PointerEvent) => {
    const { clientX: x, clientY: y, timeStamp } = event;
    const target = event.target as Element;
    const over = target.closest('.stage') !== null && target.closest(CONTROLS) === null;
    const by = event.pointerType === 'touch' ? 'touch' : 'mouse';
    newest = { x, y, by, label: over ? labelAt({ x, y }, by, timeStamp, bodyAt) : null };
  };
  document.addEventListener('pointerdown', onPress, true);
  return () => document.removeEventListener('pointerdown', onPress, true);
}

/** The label or spirit level that the last press hit, or the label of the arrow that it hit; null for none, and after a drag. */
export function pressedLabel({ x, y }: Spot): HTMLElement | null {
  if (newest === null || Math.hypot(x - newest.x, y - newest.y) > TAP_PX[newest.by]) return null;
  return newest.label;
}

function labelAt(
  press: Spot,
  by: Press['by'],
  atMs: number,
  bodyAt: (x: number, y: number) => boolean,
): HTMLElement | null {
  for (const label of document.querySelectorAll<HTMLElement>(OVER_BODY)) {
    const box = label.getBoundingClientRect();
    if (box.width > 0 && fromBox(box, press) === 0) return label;
  }
  let found: HTMLElement | null = null;
  let nearest = BESIDE_PX[by];
  for (const label of document.querySelectorAll<HTMLElement>(ARROW_LABEL)) {
    const picture = label.parentElement!.getBoundingClientRect();
    const spot = { x: press.x - picture.left, y: press.y - picture.top };
    const box = label.getBoundingClientRect();
    const far = Math.min(
      box.width > 0 ? Math.max(fromBox(box, press), ON_PX + 1) : Infinity,
      ...recentLines(label, atMs).map((line) => fromLine(line, spot)),
    );
    if (far > nearest) continue;
    nearest = far;
    found = label;
  }
  return nearest <= ON_PX || (found !== null && !bodyAt(press.x, press.y)) ? found : null;
}

function fromBox({ left, right, top, bottom }: DOMRect, { x, y }: Spot): number {
  return Math.hypot(Math.max(left - x, 0, x - right), Math.max(top - y, 0, y - bottom));
}

function fromLine([from, to]: Line, { x, y }: Spot): number {
  const [dx, dy] = [to.x - from.x, to.y - from.y];
  const square = dx * dx + dy * dy;
  const along = square === 0 ? 0 : ((x - from.x) * dx + (y - from.y) * dy) / square;
  const part = Math.min(1, Math.max(0, along));
  return Math.hypot(x - from.x - part * dx, y - from.y - part * dy);
}
