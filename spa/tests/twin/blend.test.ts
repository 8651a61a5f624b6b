import { describe, expect, it } from 'vitest';
import { blend, type Layout, shorterArc } from '../../src/twin/playback/playout.ts';
import { seeded } from '../rigs/playout_sim.ts';

const QUAT: Layout = { size: 4, wraps: new Set(), quats: [0] };
const TURNING: Layout = { size: 1, wraps: new Set([0]), quats: [] };

const blended = (layout: Layout, from: number[], to: number[], part: number) => {
  const into = new Float64Array(layout.size);
  blend(layout, Float64Array.from(from), Float64Array.from(to), part, into);
  return [...into];
};
/** A rotation about an axis as w, x, y, z. */
const turn = ([x, y, z]: readonly number[], angle: number) => {
  const s = Math.sin(angle / 2) / Math.hypot(x!, y!, z!);
  return [Math.cos(angle / 2), x! * s, y! * s, z! * s];
};
/** The angle between two orientations. */
const between = (p: readonly number[], q: readonly number[]) =>
  2 * Math.acos(Math.min(1, Math.abs(p.reduce((sum, value, i) => sum + value * q[i]!, 0))));

describe('between two orientations', () => {
  const random = seeded(7);
  const any = () => turn([random() - 0.5, random() - 0.5, random() - 0.5], random() * 2 * Math.PI);

  it('begins at one, ends at the other, stays of length 1, and turns evenly the shorter way', () => {
    for (let i = 0; i < 500; i += 1) {
      const from = any();
      const to = any();
      const whole = between(from, to);
      expect(between(blended(QUAT, from, to, 0), from)).toBeLessThan(1e-6);
      expect(between(blended(QUAT, from, to, 1), to)).toBeLessThan(1e-6);
      const part = random();
      const at = blended(QUAT, from, to, part);
      expect(Math.hypot(...at)).toBeCloseTo(1, 9);
      expect(between(from, at)).toBeCloseTo(part * whole, 3);
      expect(whole).toBeLessThanOrEqual(Math.PI);
    }
  });

  it('a change of sign is no motion', () => {
    const q = turn([0, 0, 1], 0.5);
    const other = q.map((value) => -value);
    expect(between(blended(QUAT, q, other, 0.5), q)).toBeLessThan(1e-6);
  });
});

describe('between two angles', () => {
  it('of a joint that turns on: the shorter arc', () => {
    expect(blended(TURNING, [3], [-3], 0.5)[0]).toBeCloseTo(Math.PI, 9);
    expect(blended(TURNING, [-3], [3], 0.25)[0]).toBeCloseTo(-3 - (2 * Math.PI - 6) / 4, 9);
    expect(shorterArc(0.1)).toBeCloseTo(0.1);
    expect(shorterArc(2 * Math.PI - 0.1)).toBeCloseTo(-0.1);
  });

  it('of any other: a straight line', () => {
    expect(blended({ size: 1, wraps: new Set(), quats: [] }, [3], [-3], 0.25)).toEqual([1.5]);
  });

  it('what was not known a moment ago is known at once', () => {
    expect(blended(TURNING, [Number.NaN], [2], 0.1)).toEqual([2]);
    expect(blended(QUAT, [Number.NaN, 0, 0, 0], [1, 0, 0, 0], 0.5)).toEqual([1, 0, 0, 0]);
  });
});
