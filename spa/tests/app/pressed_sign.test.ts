// @vitest-environment happy-dom
import { afterEach, beforeEach, expect, it } from 'vitest';
import { pressedLabel, watchPresses } from '../../src/app/explain/pressed_sign.ts';
import { noteLines, recentLines } from '../../src/browser/drawn_lines.ts';

/** The position of the picture in the window, CSS px. */
const [LEFT, TOP] = [50, 20];

let stage: HTMLElement;
let body: (x: number, y: number) => boolean;
let stop: () => void;

beforeEach(() => {
  stage = document.createElement('section');
  stage.className = 'stage';
  stage.getBoundingClientRect = () => new DOMRect(LEFT, TOP, 300, 300);
  document.body.replaceChildren(stage);
  body = () => false;
  stop = watchPresses((x, y) => body(x, y));
});
afterEach(() => stop());

/** A label without room, so that only its lines exist. */
function arrow(sign: string): HTMLElement {
  const label = document.createElement('div');
  label.className = 'sign-label';
  label.hidden = true;
  label.dataset.sign = sign;
  stage.append(label);
  return label;
}

/** A line from the bottom up at this place, drawn since then. */
function upright(label: HTMLElement, x: number, sinceMs: number): void {
  noteLines(
    label,
    [
      [
        { x, y: 100 },
        { x, y: 40 },
      ],
    ],
    sinceMs,
  );
}

/** Presses there (in the picture) and releases `moved` px farther. */
function tap(
  x: number,
  y: number,
  { by = 'mouse', atMs = 0, moved = 0, on = stage } = {},
): HTMLElement | null {
  const at = { clientX: LEFT + x, clientY: TOP + y, pointerType: by, bubbles: true };
  const event = new PointerEvent('pointerdown', at);
  Object.defineProperty(event, 'timeStamp', { value: atMs });
  on.dispatchEvent(event);
  return pressedLabel({ x: at.clientX + moved, y: at.clientY });
}

it('a label is found under a tap, not at the end of a drag', () => {
  const label = arrow('apart-RKN');
  label.hidden = false;
  label.getBoundingClientRect = () => new DOMRect(LEFT + 100, TOP + 100, 80, 20);
  expect(tap(120, 110)).toBe(label);
  expect(tap(120, 110, { moved: 5 })).toBe(label);
  expect(tap(120, 110, { moved: 9 })).toBeNull();
  expect(tap(120, 110, { moved: 9, by: 'touch' })).toBe(label);
  expect(tap(60, 110)).toBeNull();
});

it('an arrow is found on its shaft, and beside it where there is no body: farther by finger', () => {
  const foot = arrow('wrench-LF');
  upright(foot, 100, 0);
  for (const x of [100, 109, 115, 123]) expect(tap(x, 70), `${x}`).toBe(foot);
  expect(tap(100, 18), 'beyond its tip').toBe(foot);
  expect(tap(126, 70)).toBeNull();
  expect(tap(142, 70, { by: 'touch' })).toBe(foot);
  expect(tap(146, 70, { by: 'touch' })).toBeNull();
  body = () => true;
  expect(tap(109, 70), 'it is drawn over the body').toBe(foot);
  expect(tap(115, 70), 'the body is nearer').toBeNull();
  expect(tap(115, 70, { by: 'touch' })).toBeNull();
});

it('its number counts as much as its line, and the nearest of several wins', () => {
  const [left, right] = [arrow('wrench-LF'), arrow('wrench-RF')];
  upright(left, 100, 0);
  upright(right, 120, 0);
  expect(tap(108, 70)).toBe(left);
  expect(tap(113, 70)).toBe(right);
  right.hidden = false;
  right.getBoundingClientRect = () => new DOMRect(LEFT + 160, TOP + 40, 40, 20);
  expect(tap(180, 50)).toBe(right);
  expect(tap(215, 50)).toBe(right);
  body = () => true;
  expect(tap(215, 50)).toBeNull();
});

it('an arrow that moves is found where it was a moment ago', () => {
  const hand = arrow('wrench-RH');
  for (let i = 0; i <= 10; i++) upright(hand, 100 + 10 * i, 1000 + 20 * i); // 500 px a second
  body = () => true;
  expect(tap(200, 70, { atMs: 1200 })).toBe(hand);
  expect(tap(125, 70, { atMs: 1200 }), '150 ms ago').toBe(hand);
  expect(tap(105, 70, { atMs: 1200 })).toBeNull();
  expect(tap(125, 70, { atMs: 1400 })).toBeNull();
  expect(tap(200, 70, { atMs: 9000 }), 'one that has come to rest stays').toBe(hand);
  for (let i = 0; i < 1000; i++) upright(hand, i, 2000 + i);
  expect(recentLines(hand, 3000).length).toBeLessThan(15);
});

it("a deviation's line leaves the tap to its joint; buttons over the picture have their own meaning", () => {
  const knee = arrow('apart-RKN');
  upright(knee, 100, 0);
  expect(tap(100, 70)).toBeNull();
  const foot = arrow('wrench-RF');
  upright(foot, 100, 0);
  const button = document.createElement('button');
  stage.append(button);
  expect(tap(100, 70)).toBe(foot);
  expect(tap(100, 70, { on: button })).toBeNull();
  expect(tap(100, 70, { on: document.body })).toBeNull();
});
