import { type RefObject, useEffect, useEffectEvent, useRef, useState } from 'react';
import { settings } from '../state/settings.ts';
import type { More } from '../text/more_en.ts';

interface PageKey {
  /** `page`, `past`: anywhere, unless a dialog, a menu or a text field has the focus. `camera`: while nothing else has the focus.
   *  `line`: while the time line has it. */
  readonly where: 'page' | 'past' | 'camera' | 'line';
  /** As in `KeyboardEvent.key`, letters in lower case. */
  readonly keys: readonly string[];
  /** Whether Shift must be held; if omitted, it makes no difference. */
  readonly shift?: boolean;
  /** Whether it goes on while the key is held. */
  readonly repeats?: true;
  /** Its description. Keys with the same one are listed together. */
  readonly says: keyof More;
}

const ARROWS = ['ArrowLeft', 'ArrowRight', 'ArrowUp', 'ArrowDown'] as const;

/** All keyboard shortcuts of the page, in display order. The parts of the page take up what they can do with `addPageKeys`. */
export const PAGE_KEYS = {
  numbers: { where: 'page', keys: ['t'], says: 'keyNumbers' },
  fullscreen: { where: 'page', keys: ['f'], says: 'keyFullscreen' },
  present: { where: 'page', keys: ['p'], says: 'keyPresent' },
  share: { where: 'page', keys: ['s'], says: 'keyShare' },
  list: { where: 'page', keys: ['?'], says: 'keyThese' },
  close: { where: 'page', keys: ['Escape'], says: 'keyEscape' },

  play: { where: 'past', keys: [' '], shift: false, says: 'keyPlay' },
  frameBack: { where: 'past', keys: [','], repeats: true, says: 'keyFrame' },
  frameOn: { where: 'past', keys: ['.'], repeats: true, says: 'keyFrame' },
  tenBack: { where: 'past', keys: ['j'], repeats: true, says: 'keyTen' },
  tenOn: { where: 'past', keys: ['l'], repeats: true, says: 'keyTen' },
  faultBack: { where: 'past', keys: ['b'], says: 'keyFault' },
  faultOn: { where: 'past', keys: ['n'], says: 'keyFault' },
  slower: { where: 'past', keys: ['['], says: 'keySpeed' },
  faster: { where: 'past', keys: [']'], says: 'keySpeed' },
  loop: { where: 'past', keys: ['o'], says: 'keyLoop' },
  save: { where: 'past', keys: ['x'], says: 'keySave' },
  live: { where: 'past', keys: ['e'], says: 'keyLive' },
  jump: { where: 'past', keys: ['g'], says: 'keyJump' },

  lineBack: {
    where: 'line',
    keys: ['ArrowLeft', 'ArrowDown'],
    repeats: true,
    says: 'keyOnLine',
  },
  lineOn: { where: 'line', keys: ['ArrowRight', 'ArrowUp'], repeats: true, says: 'keyOnLine' },
  minuteOn: { where: 'line', keys: ['PageUp'], repeats: true, says: 'keyMinute' },
  minuteBack: { where: 'line', keys: ['PageDown'], repeats: true, says: 'keyMinute' },
  oldest: { where: 'line', keys: ['Home'], says: 'keyEnds' },
  newest: { where: 'line', keys: ['End'], says: 'keyEnds' },
  lineNearer: { where: 'line', keys: ['+', '='], repeats: true, says: 'keyScale' },
  lineFarther: { where: 'line', keys: ['-'], repeats: true, says: 'keyScale' },

  turn: {
    where: 'camera',
    keys: ARROWS,
    shift: false,
    repeats: true,
    says: 'keyTurn',
  },
  pan: {
    where: 'camera',
    keys: ARROWS,
    shift: true,
    repeats: true,
    says: 'keyMove',
  },
  nearer: { where: 'camera', keys: ['+', '='], repeats: true, says: 'keyNearer' },
  farther: { where: 'camera', keys: ['-'], repeats: true, says: 'keyNearer' },
  front: { where: 'camera', keys: ['1'], says: 'keyViews' },
  side: { where: 'camera', keys: ['2'], says: 'keyViews' },
  top: { where: 'camera', keys: ['3'], says: 'keyViews' },
  home: { where: 'camera', keys: ['0'], says: 'keyFirst' },
  closeUp: { where: 'camera', keys: ['c'], says: 'keyClose' },
} as const satisfies Readonly<Record<string, PageKey>>;

export type KeyAction = keyof typeof PAGE_KEYS;
/** What a part of the page does at present. */
export type KeyHandlers = { readonly [Action in KeyAction]?: (event: KeyboardEvent) => void };

interface Registered {
  readonly handlers: () => KeyHandlers;
  readonly element: Element | null;
}

/** A key as it is listed: `T`, `Space`, `Home`. */
export function signOf(key: string): string {
  if (key === ' ') return 'Space';
  return key.length === 1 ? key.toUpperCase() : key;
}

/** Words with the key that does the same, unless keys of one character are switched off: `Share (S)`. */
export function withKey(words: string, action: KeyAction): string {
  const [key] = PAGE_KEYS[action].keys;
  return settings().characterKeys ? `${words} (${signOf(key)})` : words;
}

const TYPED_INTO =
  'input:not([type="radio"], [type="checkbox"], [type="range"]), textarea, select, [contenteditable]';
/** Elements that handle Space themselves. A button or tab that was clicked is excluded: after a click, Space is meant for the
 *  page; after keyboard focus, it presses the element. */
const TAKES_SPACE = 'button, a, input, summary, [role="button"], [role="tab"], [role="separator"]';

/** The newest last. */
let registered: readonly Registered[] = [];
/** The last element that was clicked and takes Space. */
let clicked: Element | null = null;

/**
 * Takes up keys, by what they do. Returns a function that gives them back. `handlers` is called at each key, so that it can
 * follow what is possible. The newest part that can use a key gets it, so that Escape closes one thing at a time.
 *
 * `element`: the element of the time line or camera. Of something that can be closed, it is a menu: while the focus is in it,
 * nothing else gets keys.
 */
export function addPageKeys(handlers: () => KeyHandlers, element: Element | null = null): () => void {
  const added = { handlers, element };
  if (registered.length === 0) {
    window.addEventListener('keydown', onKey);
    window.addEventListener('pointerdown', onPointer, true);
  }
  registered = [...registered, added];
  return () => {
    registered = registered.filter((each) => each !== added);
    if (registered.length > 0) return;
    window.removeEventListener('keydown', onKey);
    window.removeEventListener('pointerdown', onPointer, true);
  };
}

/** Takes up keys while the component is shown and `handlers` is not null; see `addPageKeys`. */
export function usePageKeys(handlers: (() => KeyHandlers) | null, element?: RefObject<Element | null>): void {
  const now = useEffectEvent(() => handlers?.() ?? {});
  const isOn = handlers !== null;
  useEffect(() => (isOn ? addPageKeys(() => now(), element?.current) : undefined), [isOn, element]);
}

function onPointer({ target }: PointerEvent): void {
  clicked = target instanceof Element ? target.closest(TAKES_SPACE) : null;
}

function onKey(event: KeyboardEvent): void {
  if (event.key === 'Tab') clicked = null;
  if (event.defaultPrevented || event.isComposing || event.keyCode === 229) return;
  const { ctrlKey, altKey, metaKey } = event;
  if (ctrlKey || altKey || metaKey || event.getModifierState('AltGraph')) return; // those are the browser's
  const key = keyOf(event);
  if (key.length === 1 && !settings().characterKeys) return;
  const at = event.target instanceof Element ? event.target : document.body;
  if (at.closest(TYPED_INTO) !== null || document.querySelector('dialog[open]') !== null) return;
  if (key === ' ' && pressesItself(at)) return;
  const parts = registered.toReversed().map(({ handlers, element }) => ({ all: handlers(), element }));
  const menu = parts.find(({ all, element }) => all.close !== undefined && element?.contains(at));
  for (const part of menu === undefined ? parts : [menu]) {
    const action = (Object.keys(part.all) as KeyAction[]).find((each) => isMeant(each, key, event, at, part));
    if (action === undefined) continue;
    event.preventDefault();
    const { repeats }: PageKey = PAGE_KEYS[action];
    if (!event.repeat || repeats) part.all[action]?.(event);
    return;
  }
}

function isMeant(
  action: KeyAction,
  key: string,
  { shiftKey }: KeyboardEvent,
  at: Element,
  { all, element }: { readonly all: KeyHandlers; readonly element: Element | null },
): boolean {
  const { where, keys, shift }: PageKey = PAGE_KEYS[action];
  if (all[action] === undefined || !keys.includes(key) || (shift ?? shiftKey) !== shiftKey) return false;
  const isInside = element?.contains(at) === true;
  if (where === 'line') return isInside;
  return where !== 'camera' || isInside || at === document.body || at === document.documentElement;
}

function pressesItself(at: Element): boolean {
  const taker = at.closest(TAKES_SPACE);
  return taker !== null && (taker !== clicked || taker.matches('input'));
}

/** The signs on a US keyboard without and with Shift. */
const SIGNS: Readonly<Record<string, string>> = {
  Comma: ',<',
  Period: '.>',
  Slash: '/?',
  BracketLeft: '[{',
  BracketRight: ']}',
  Minus: '-_',
  Equal: '=+',
};

/** What a key means: its sign or its name. With a layout for other letters, such as Hangul, the place of the key decides. */
function keyOf({ key, code, shiftKey }: KeyboardEvent): string {
  if (/^[ -~]$/.test(key)) return key.toLowerCase();
  const [, letter] = /^(?:Key|Digit)(.)$/.exec(code) ?? [];
  return letter?.toLowerCase() ?? SIGNS[code]?.[Number(shiftKey)] ?? key;
}

/** The state of a popover. While it is open, Escape or a press outside the element `around` closes it. */
export function usePopover<T extends HTMLElement>(): {
  open: boolean;
  setOpen: (open: boolean) => void;
  around: RefObject<T | null>;
} {
  const [open, setOpen] = useState(false);
  const around = useRef<T>(null);
  useEffect(() => {
    if (!open) return;
    const leave = ({ target }: Event) => {
      if (!around.current?.contains(target as Node)) setOpen(false);
    };
    window.addEventListener('pointerdown', leave);
    return () => window.removeEventListener('pointerdown', leave);
  }, [open]);
  usePageKeys(open ? () => ({ close: () => setOpen(false) }) : null, around);
  return { open, setOpen, around };
}
