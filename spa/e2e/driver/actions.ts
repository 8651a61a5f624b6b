/** Input in the format of both WebDriver protocols (https://www.w3.org/TR/webdriver2/#actions). */

import type { Button, Finger, Json, Point } from './page.ts';

const BUTTONS: Readonly<Record<Button, number>> = { left: 0, middle: 1, right: 2 };
/** A drag is recognised only if it passes through intermediate points. */
const STEPS = 6;
const STEP_MS = 16;

/** https://www.w3.org/TR/webdriver2/#keyboard-actions */
const KEYS: Readonly<Record<string, string>> = {
  Backspace: '\ue003',
  Tab: '\ue004',
  Enter: '\ue007',
  Shift: '\ue008',
  Control: '\ue009',
  Alt: '\ue00a',
  Escape: '\ue00c',
  Space: ' ',
  PageUp: '\ue00e',
  PageDown: '\ue00f',
  End: '\ue010',
  Home: '\ue011',
  ArrowLeft: '\ue012',
  ArrowUp: '\ue013',
  ArrowRight: '\ue014',
  ArrowDown: '\ue015',
  Delete: '\ue017',
  Meta: '\ue03d',
};

export type Actions = readonly Json[];

export function keys(combination: string): Actions {
  const names = combination === '+' ? ['+'] : combination.split('+');
  const values = names.map((name) => {
    const value = KEYS[name] ?? name;
    if ([...value].length !== 1) throw new Error(`no such key: ${name}`);
    return value;
  });
  return [
    {
      type: 'key',
      id: 'keyboard',
      actions: [
        ...values.map((value) => ({ type: 'keyDown', value })),
        ...values.toReversed().map((value) => ({ type: 'keyUp', value })),
      ],
    },
  ];
}

export function click(at: Point, times = 1): Actions {
  const press = [
    { type: 'pointerDown', button: 0 },
    { type: 'pointerUp', button: 0 },
  ];
  return [mouse([move(at), ...Array.from({ length: times }, () => press).flat()])];
}

export function drag({ from, to }: Finger, button: Button): Actions {
  return [
    mouse([
      move(from),
      { type: 'pointerDown', button: BUTTONS[button] },
      ...line({ from, to }).map((at) => move(at, STEP_MS)),
      { type: 'pointerUp', button: BUTTONS[button] },
    ]),
  ];
}

export function wheel(at: Point, pixels: number): Actions {
  const scroll = { type: 'scroll', ...whole(at), deltaX: 0, deltaY: Math.round(pixels) };
  return [{ type: 'wheel', id: 'wheel', actions: [scroll] }];
}

export function touch(fingers: readonly Finger[]): Actions {
  return fingers.map((finger, i) => ({
    type: 'pointer',
    id: `finger${i}`,
    parameters: { pointerType: 'touch' },
    actions: [
      move(finger.from),
      { type: 'pointerDown', button: 0 },
      ...line(finger).map((at) => move(at, STEP_MS)),
      { type: 'pointerUp', button: 0 },
    ],
  }));
}

export function doubleTap(at: Point): Actions {
  const tap = [
    { type: 'pointerDown', button: 0 },
    { type: 'pointerUp', button: 0 },
  ];
  const actions = [move(at), ...tap, ...tap];
  return [{ type: 'pointer', id: 'finger0', parameters: { pointerType: 'touch' }, actions }];
}

/** The points of a straight line, including its end but not its start. */
export function line({ from, to }: Finger): Point[] {
  return Array.from({ length: STEPS }, (_, i) => {
    const part = (i + 1) / STEPS;
    return { x: from.x + (to.x - from.x) * part, y: from.y + (to.y - from.y) * part };
  });
}

function mouse(actions: readonly Json[]): Json {
  return { type: 'pointer', id: 'mouse', parameters: { pointerType: 'mouse' }, actions };
}

function move(to: Point, duration = 0): Json {
  return { type: 'pointerMove', ...whole(to), duration };
}

function whole({ x, y }: Point): { x: number; y: number } {
  return { x: Math.round(x), y: Math.round(y) };
}
