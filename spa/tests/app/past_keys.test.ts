// @vitest-environment happy-dom
import { afterEach, beforeEach, describe, expect, it } from 'vitest';
import { chosenOn, lineKeys, pastKeys } from '../../src/app/past/time_line/line.ts';
import { addPageKeys } from '../../src/app/shell/page_keys.ts';
import { FakePast } from '../rigs/past_fake.ts';

const T = Date.UTC(2026, 10, 22, 14, 30);
let past: FakePast;
let save: (() => void) | null = null;
let line: HTMLElement;
let leave: readonly (() => void)[] = [];

beforeEach(() => {
  past = new FakePast(T);
  save = null;
  line = document.body.appendChild(document.createElement('div'));
  leave = [addPageKeys(() => pastKeys(past, save)), addPageKeys(() => lineKeys(past, T), line)];
});

afterEach(() => {
  for (const off of leave) off();
  document.body.replaceChildren();
});

/** Whether the page takes the key. */
function press(key: string, more: KeyboardEventInit = {}, to: Element = document.body): boolean {
  const event = new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true, ...more });
  to.dispatchEvent(event);
  return event.defaultPrevented;
}
const onTrack = (key: string, shiftKey = false) => press(key, { shiftKey }, line);

describe('keys all over the page', () => {
  it('play, skip, step, change the speed and visit faults', () => {
    past.rest(100);
    for (const key of [' ', ',', '.', 'j', 'L', 'b', 'n', ']', ']', ']', '[']) expect(press(key)).toBe(true);
    expect(past.told).toEqual([
      ...['toggle', 'step -1', 'step 1', 'skip -10000', 'skip 10000', 'fault -1', 'fault 1'],
      ...['speed 2', 'speed 4', 'speed 2'],
    ]);
    for (const key of ['t', 'f', 's', 'p', 'c', '?', '1', 'ArrowLeft', 'Escape'])
      expect(press(key), key).toBe(false);
  });

  it('save, where something can be saved', () => {
    let saved = 0;
    expect(press('x')).toBe(false);
    save = () => {
      saved += 1;
    };
    expect(press('x')).toBe(true);
    expect(press('ㅌ', { code: 'KeyX' })).toBe(true);
    expect(saved).toBe(2);
    expect(past.told).toEqual([]);
  });

  it('lead from live into the past, and to nothing that is not yet', () => {
    for (const key of ['.', 'l', 'n', ']', 'o', 'e']) expect(press(key), key).toBe(false);
    expect(past.told).toEqual([]);
    for (const key of [',', 'j', 'b', ' ']) press(key);
    expect(past.told).toEqual(['step -1', 'skip -10000', 'fault -1', 'toggle']);
  });

  it('do nothing where there is no past', () => {
    past.timeline = null;
    expect(press(' ')).toBe(false);
    expect(past.told).toEqual([]);
  });

  it('lead back to live', () => {
    past.rest(100);
    expect(press('E')).toBe(true);
    expect(past.told.at(-1)).toBe('live');
  });

  it('step on while they are held, but toggle, set and visit once', () => {
    past.rest(100);
    for (const key of [',', '.', 'j', 'l', ' ', 'b', 'n', '[', ']', 'o', 'e', 'g'])
      expect(press(key, { repeat: true }), key).toBe(true);
    expect(past.told).toEqual(['step -1', 'step 1', 'skip -10000', 'skip 10000']);
    expect(chosenOn(past).get().loopStartMs).toBeNull();
  });

  it('set a loop with the first and second press and end it with the third', () => {
    past.rest(100);
    press('o');
    expect(chosenOn(past).get().loopStartMs).toBe(T - 100_000);
    past.rest(130);
    press('o');
    past.rest(110);
    press('o');
    expect(past.told).toEqual(['loop 130 to 100', 'no loop']);
    expect(chosenOn(past).get().loopStartMs).toBeNull();
  });

  it('make no loop of no length', () => {
    past.rest(100);
    press('o');
    press('o');
    expect(past.told).toEqual([]);
  });
});

describe('keys on the time line', () => {
  it('go by a second, ten or a minute', () => {
    past.rest(100);
    for (const [key, shift] of [
      ['ArrowLeft', false],
      ['ArrowRight', true],
      ['PageDown', false],
      ['PageUp', false],
    ] as const)
      expect(onTrack(key, shift)).toBe(true);
    expect(past.told).toEqual(['seek 101', 'seek 91', 'seek 151', 'seek 91']);
  });

  it('end at the oldest and at live', () => {
    past.rest(599.5);
    onTrack('ArrowLeft');
    past.rest(0.5);
    onTrack('ArrowRight');
    onTrack('ArrowRight');
    onTrack('Home');
    onTrack('End');
    expect(past.told).toEqual(['seek 600', 'live', 'seek 600', 'live']);
    expect(onTrack('Enter')).toBe(false);
  });
});
