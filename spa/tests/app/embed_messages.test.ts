import { describe, expect, it } from 'vitest';
import { parentOrigin, readParentRequest } from '../../src/app/pages/embed/parent.ts';

describe('the page around a frame', () => {
  it('may ask for what the frame knows', () => {
    expect(readParentRequest({ posecast: 'look', view: 'side' })).toEqual({ posecast: 'look', view: 'side' });
    expect(readParentRequest({ posecast: 'select', joint: 'RKN' })).toEqual({
      posecast: 'select',
      joint: 'RKN',
    });
    expect(readParentRequest({ posecast: 'select', joint: null })).toEqual({
      posecast: 'select',
      joint: null,
    });
    expect(readParentRequest({ posecast: 'play', speed: 8 })).toEqual({ posecast: 'play' });
    expect(readParentRequest({ posecast: 'set', angle: 'deg', theme: 'pink', palette: 'safe' })).toEqual({
      posecast: 'set',
      changed: { angle: 'deg' },
    });
  });

  it('may say anything', () => {
    const odd = [null, 'look', 7, [], {}, { posecast: 'look' }, { posecast: 'look', view: '__proto__' }];
    for (const data of [
      ...odd,
      { posecast: 'select', joint: 7 },
      { posecast: 'set', theme: {} },
      { posecast: 'x' },
    ]) {
      expect(readParentRequest(data)).toBeNull();
    }
  });

  it('is the one that the address names, and nobody else', () => {
    expect(parentOrigin('?origin=https://course.example/week-3?x')).toBe('https://course.example');
    for (const none of [
      '',
      '?origin=',
      '?origin=*',
      '?origin=null',
      '?origin=javascript:alert(1)',
      '?origin=data:,x',
    ]) {
      expect(parentOrigin(none), none).toBeNull();
    }
  });
});
