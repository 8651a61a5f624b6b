import { describe, expect, it } from 'vitest';
import { readShared, sharedQuery } from '../../src/app/share/view_address.ts';
import { momentIn, queryOf } from '../../src/app/state/address.ts';
import { readSettings } from '../../src/app/state/settings.ts';

const usual = readSettings(null);

describe('a shared view', () => {
  it('says nothing of what is as usual', () => {
    expect(sharedQuery(usual, { momentMs: null, joint: null, eye: null })).toBe('');
  });

  it('comes back as it was', () => {
    const view = {
      momentMs: Date.UTC(2026, 10, 22, 14, 2, 7, 250),
      joint: 'left knee & co/+=',
      eye: { position: [2.125, -0.4, 1.2], target: [0, 0.01, 0.6] },
    } as const;
    const query = sharedQuery({ ...usual, angle: 'deg', theme: 'dark', shown: 'both' }, view);
    expect(query).toBe(
      '?t=2026-11-22T14:02:07.250Z&shown=both&angle=deg&theme=dark&joint=left%20knee%20%26%20co%2F%2B%3D&eye=2.13,-0.4,1.2,0,0.01,0.6',
    );
    const read = queryOf(`#/r/demo${query}`);
    expect(readShared(read)).toEqual({
      joint: view.joint,
      eye: { position: [2.13, -0.4, 1.2], target: [0, 0.01, 0.6] },
    });
    expect(momentIn(`#/r/demo${query}`)).toBe(view.momentMs);
    expect(read.get('angle')).toBe('deg');
  });

  it('may be anything', () => {
    for (const odd of [
      '',
      '1,2,3',
      '1,2,3,4,5,six',
      '1,,3,4,5,6',
      '1,2,3,1,2,3',
      '1e9,0,0,0,0,0',
      'NaN,0,0,0,0,0',
    ]) {
      expect(readShared(new URLSearchParams({ eye: odd })).eye, odd).toBeNull();
    }
    for (const odd of [
      '',
      'now',
      '2026-11-22',
      '2026-11-22T14:02:07',
      '2026-13-22T14:02:07Z',
      '1e99',
      `2026-11-22T14:02:07.${'0'.repeat(99)}Z`,
    ])
      expect(momentIn(`#/r/demo?t=${odd}`), odd).toBeNull();
    expect(readShared(queryOf('#/r/demo'))).toEqual({ joint: null, eye: null });
    expect(readShared(new URLSearchParams({ joint: 'x'.repeat(9000) })).joint).toHaveLength(200);
  });
});
