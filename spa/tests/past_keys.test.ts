import { beforeEach, describe, expect, it } from 'vitest';
import { loopStart } from '../src/app/past/time_line/loop_start.ts';
import { playPastKey, playTrackKey } from '../src/app/past/time_line/past_keys.ts';
import { FakePast } from './past_fake.ts';

const T = Date.UTC(2026, 10, 22, 14, 30);
let past: FakePast;
beforeEach(() => {
  past = new FakePast(T);
});

const keyOf = (key: string, more: Partial<KeyboardEvent> = {}) => ({
  ...{ key, code: '', repeat: false, shiftKey: false },
  ...more,
});
const press = (key: string, more?: Partial<KeyboardEvent>) => playPastKey(past, keyOf(key, more));
const onTrack = (key: string, shiftKey = false) => playTrackKey(past, T, keyOf(key, { shiftKey }));

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
    const save = () => {
      saved += 1;
    };
    expect(playPastKey(past, keyOf('x'), save)).toBe(true);
    expect(playPastKey(past, keyOf('ㅌ', { code: 'KeyX' }), save)).toBe(true);
    expect(saved).toBe(2);
    expect(press('x')).toBe(false);
    expect(past.told).toEqual([]);
  });

  it('are the same where Korean letters are typed', () => {
    past.rest(100);
    expect(press('ㅓ', { code: 'KeyJ' })).toBe(true);
    expect(past.told).toEqual(['skip -10000']);
  });

  it('lead from live into the past, and to nothing that is not yet', () => {
    for (const key of ['.', 'l', 'n', ']', 'o']) press(key);
    expect(past.told).toEqual([]);
    for (const key of [',', 'j', 'b', ' ']) press(key);
    expect(past.told).toEqual(['step -1', 'skip -10000', 'fault -1', 'toggle']);
  });

  it('lead back to live', () => {
    expect(press('e')).toBe(false);
    past.rest(100);
    expect(press('E')).toBe(true);
    expect(past.told.at(-1)).toBe('live');
  });

  it('toggle once, however long they are held', () => {
    press(' ', { repeat: true });
    expect(past.told).toEqual([]);
  });

  it('set a loop with the first and second press and end it with the third', () => {
    past.rest(100);
    press('o');
    expect(loopStart(past).get()).toBe(T - 100_000);
    past.rest(130);
    press('o');
    past.rest(110);
    press('o');
    expect(past.told).toEqual(['loop 130 to 100', 'no loop']);
    expect(loopStart(past).get()).toBeNull();
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
