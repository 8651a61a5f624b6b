// @vitest-environment happy-dom
import { readFileSync } from 'node:fs';
import path from 'node:path';
import { createElement, useEffect } from 'react';
import { createRoot } from 'react-dom/client';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { KeysSheet } from '../../src/app/settings/KeysSheet.tsx';
import {
  addPageKeys,
  type KeyAction,
  PAGE_KEYS,
  signOf,
  usePageKeys,
  usePopover,
  withKey,
} from '../../src/app/shell/page_keys.ts';
import { changeSettings } from '../../src/app/state/settings.ts';
import { pastControls } from '../../src/app/state/viewing.ts';
import { moreKo } from '../../src/app/text/ko.ts';
import { FakePast } from '../rigs/past_fake.ts';

const ACTIONS = Object.keys(PAGE_KEYS) as KeyAction[];
/** What can be taken up: not what elements do themselves, and not what needs the focus on the time line. */
const TAKEN = ACTIONS.filter(
  (each) => !['move', 'arrows'].includes(each) && PAGE_KEYS[each].where !== 'line',
);
let done: string[] = [];
let leave: (() => void)[] = [];

beforeEach(() => {
  done = [];
});

afterEach(() => {
  for (const off of leave) off();
  leave = [];
  changeSettings({ characterKeys: true });
  document.body.replaceChildren();
});

/** Takes up keys; what they do is noted with `name` in front. */
function take(actions: readonly KeyAction[], element: Element | null = null, name = ''): () => void {
  const handlers = Object.fromEntries(actions.map((each) => [each, () => void done.push(name + each)]));
  const off = addPageKeys(() => handlers, element);
  leave.push(off);
  return off;
}

/** Whether the page takes the key. */
function press(
  key: string,
  more: KeyboardEventInit & { keyCode?: number } = {},
  to: Element = document.body,
) {
  const event = new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true, ...more });
  to.dispatchEvent(event);
  return event.defaultPrevented;
}

const add = <Name extends keyof HTMLElementTagNameMap>(name: Name, more: object = {}) =>
  document.body.appendChild(Object.assign(document.createElement(name), more));

/** A key that an action has, as an event. */
const eventOf = (action: KeyAction): [string, KeyboardEventInit] => {
  const { keys, shift = false }: { keys: readonly string[]; shift?: boolean } = PAGE_KEYS[action];
  return [keys[0]!, { shiftKey: shift }];
};

describe('the keys of the page', () => {
  it('are each one action in one place', () => {
    for (const a of ACTIONS)
      for (const b of ACTIONS) {
        const [one, other] = [PAGE_KEYS[a], PAGE_KEYS[b]];
        if (a >= b || one.where !== other.where) continue;
        const shared = one.keys.filter((key) => (other.keys as readonly string[]).includes(key));
        if ([a, b].sort().join() !== 'pan,turn') expect(shared, `${a} and ${b}`).toEqual([]);
      }
    const global = ACTIONS.filter((each) => ['page', 'past'].includes(PAGE_KEYS[each].where));
    const letters = global.flatMap((each) => [...PAGE_KEYS[each].keys]).filter((key) => key.length === 1);
    const ofCamera = ACTIONS.filter((each) => PAGE_KEYS[each].where === 'camera');
    expect(
      letters.filter((key) => ofCamera.some((each) => PAGE_KEYS[each].keys.includes(key as never))),
    ).toEqual([]);
  });

  it('do what their part of the page can do, and nothing that no part can', () => {
    take(['numbers']);
    expect([press('t'), press('T', { shiftKey: true }), press('f'), press('constructor')]).toEqual([
      ...[true, true],
      ...[false, false],
    ]);
    expect(done).toEqual(['numbers', 'numbers']);
    leave.pop()?.();
    expect(press('t')).toBe(false);
  });

  it('are those that a keyboard for other letters has in their place', () => {
    take(TAKEN);
    const hangul: readonly (readonly [string, string, KeyAction, boolean?])[] = [
      ['ㅅ', 'KeyT', 'numbers'],
      ['ㄹ', 'KeyF', 'fullscreen'],
      ['ㅔ', 'KeyP', 'present'],
      ['ㄴ', 'KeyS', 'share'],
      ['ㅊ', 'KeyC', 'closeUp'],
      ['ㅓ', 'KeyJ', 'tenBack'],
      ['е', 'KeyT', 'numbers'],
      ['ю', 'Period', 'frameOn'],
      ['х', 'BracketLeft', 'slower'],
      ['؟', 'Slash', 'list', true],
      ['？', 'Slash', 'list', true],
      ['Process', 'KeyT', 'numbers'],
    ];
    for (const [key, code, action, shiftKey = false] of hangul) {
      done = [];
      expect(press(key, { code, shiftKey }), key).toBe(true);
      expect(done).toEqual([action]);
    }
    done = [];
    press('t', { code: 'KeyK' }); // Dvorak: the letter decides
    press('k', { code: 'KeyT' });
    press('?', { code: 'Comma', shiftKey: true }); // French
    press('.', { code: 'Comma', shiftKey: true });
    expect(done).toEqual(['numbers', 'list', 'frameOn']);
  });

  it('are left to the browser with Ctrl, Alt or the command key, and to who composes a letter', () => {
    take(TAKEN);
    for (const action of ACTIONS) {
      const [key, more] = eventOf(action);
      for (const modifier of ['ctrlKey', 'altKey', 'metaKey'])
        expect(press(key, { ...more, [modifier]: true }), `${modifier} ${key}`).toBe(false);
    }
    expect(press('ㅅ', { code: 'KeyT', isComposing: true })).toBe(false);
    expect(press('Process', { code: 'KeyT', keyCode: 229 })).toBe(false);
    expect(done).toEqual([]);
  });

  it('do nothing behind a dialog, in a field, or for who has done something with the key', () => {
    take(TAKEN);
    const dialog = add('dialog');
    const inside = dialog.appendChild(document.createElement('button'));
    dialog.setAttribute('open', '');
    const targets = [document.body, inside];
    for (const action of ACTIONS)
      for (const to of targets) expect(press(...eventOf(action), to), action).toBe(false);
    dialog.remove();
    const editable = add('div');
    editable.setAttribute('contenteditable', 'true');
    for (const field of [
      add('input'),
      add('input', { type: 'search' }),
      add('textarea'),
      add('select'),
      editable,
    ])
      for (const action of ACTIONS) expect(press(...eventOf(action), field), action).toBe(false);
    const busy = add('div');
    busy.addEventListener('keydown', (event) => event.preventDefault());
    press('t', {}, busy);
    expect(done).toEqual([]);
    for (const type of ['radio', 'checkbox', 'range'])
      expect(press('t', {}, add('input', { type }))).toBe(true);
  });

  it('go on while they are held only where that is right', () => {
    take(TAKEN);
    for (const action of TAKEN) {
      const [key, more] = eventOf(action);
      expect(press(key, { ...more, repeat: true }), 'nobody else gets it either').toBe(true);
    }
    const stepping = ['frameBack', 'frameOn', 'tenBack', 'tenOn', 'turn', 'pan', 'nearer', 'farther'];
    expect(done).toEqual(stepping);
  });
});

describe('the focus', () => {
  it('decides between the camera and the time line', () => {
    const canvas = add('div');
    const line = add('div');
    take(['turn', 'nearer'], canvas);
    take(['lineBack', 'lineNearer'], line);
    const button = add('button');
    for (const to of [document.body, canvas, line]) {
      press('ArrowLeft', {}, to);
      press('+', { shiftKey: true }, to);
    }
    expect([press('ArrowLeft', {}, button), press('+', {}, button)]).toEqual([false, false]);
    expect(done).toEqual(['turn', 'nearer', 'turn', 'nearer', 'lineBack', 'lineNearer']);
  });

  it('in a menu keeps all keys from the page', () => {
    take(['numbers', 'play']);
    const menu = add('fieldset');
    const radio = menu.appendChild(Object.assign(document.createElement('input'), { type: 'radio' }));
    const close = take(['close'], menu);
    expect(press('t', {}, radio)).toBe(false);
    expect(press('Escape', {}, radio)).toBe(true);
    close();
    expect(press('t', {}, radio)).toBe(true);
    expect(done).toEqual(['close', 'numbers']);
  });

  it('on a button gives it Space, unless it was only clicked', () => {
    take(['play']);
    const button = add('button');
    expect(press(' ', {}, button)).toBe(false);
    button.dispatchEvent(new PointerEvent('pointerdown', { bubbles: true }));
    expect(press(' ', {}, button)).toBe(true);
    press('Tab');
    expect(press(' ', {}, button)).toBe(false);
    expect(press(' ', { shiftKey: true })).toBe(false);
    expect(done).toEqual(['play']);
  });
});

function Page() {
  const { open, setOpen, around } = usePopover<HTMLDivElement>();
  usePageKeys(() => ({ close: () => done.push('page'), numbers: () => setOpen(true) }));
  useEffect(() => {
    document.title = open ? 'open' : 'shut'; // by now the keys are taken up
  }, [open]);
  return createElement('div', { ref: around });
}

describe('Escape', () => {
  it('closes one thing, the newest', () => {
    const names = ['card', 'presenting', 'menu'];
    const off = names.map((name) => take(['close'], null, `${name} `));
    for (const close of off.toReversed()) {
      press('Escape');
      press('Escape', { repeat: true });
      close();
    }
    expect(press('Escape')).toBe(false);
    expect(done).toEqual(['menu close', 'presenting close', 'card close']);
  });

  it('closes a popover and leaves the rest', async () => {
    const root = createRoot(add('div'));
    root.render(createElement(Page));
    await vi.waitFor(() => expect(document.title).toBe('shut'));
    press('t');
    await vi.waitFor(() => expect(document.title).toBe('open'));
    press('Escape');
    await vi.waitFor(() => expect(document.title).toBe('shut'));
    expect(done).toEqual([]);
    press('Escape');
    expect(done).toEqual(['page']);
    root.unmount();
  });
});

describe('keys of one character', () => {
  it('can be switched off; those with a name stay', () => {
    expect(withKey('Share', 'share')).toBe('Share (S)');
    changeSettings({ characterKeys: false });
    expect(withKey('Share', 'share')).toBe('Share');
    take(TAKEN);
    for (const action of ACTIONS) press(...eventOf(action));
    press('ㅅ', { code: 'KeyT' });
    const named = (action: string) =>
      ACTIONS.some((each) => each === action && PAGE_KEYS[each].keys[0]!.length > 1);
    expect(done.length).toBeGreaterThan(0);
    expect(done.filter((action) => !named(action))).toEqual([]);
  });
});

it('the guide lists the keys that the page has', () => {
  const guide = readFileSync(
    path.join(import.meta.dirname, '../../../docs/how-to/watch/keyboard.md'),
    'utf8',
  );
  const cells = [...guide.matchAll(/^\| (.*?) \|/gm)].map(([, cell]) => cell!);
  const listed = cells.flatMap((cell) => [...cell.matchAll(/`([^`]+)`/g)].map(([, key]) => key!));
  const signs = ACTIONS.map((each) => signOf(PAGE_KEYS[each].keys[0])).filter((sign) => !/^Arrow/.test(sign));
  expect(new Set(listed)).toEqual(new Set([...signs, 'Tab', 'Enter']));
});

afterEach(() => {
  pastControls.set(null);
  document.body.replaceChildren();
});

async function keysOf(recorded: object | null): Promise<string> {
  const past = new FakePast(Date.UTC(2026, 10, 22, 14, 30));
  Object.assign(past.playhead, { recorded });
  pastControls.set(past);
  const host = document.body.appendChild(document.createElement('div'));
  const root = createRoot(host);
  root.render(createElement(KeysSheet, { onClose: () => {} }));
  await vi.waitFor(() => expect(document.body.textContent).toContain('Home End'));
  const said = document.body.textContent ?? '';
  root.unmount();
  return said;
}

it('names what leads to live, where there is a present', async () => {
  expect(await keysOf(null)).toMatch(/back to live.*the oldest, live/s);
});

it('says of a recording where it begins and ends, and nothing of live', async () => {
  const said = await keysOf({});
  expect(said).toContain('on the time line: the beginning, the end');
  expect(said).not.toMatch(/\blive\b/);
  expect(moreKo.keyRecordedEnds).not.toContain('실시간');
});
