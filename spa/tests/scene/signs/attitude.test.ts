import { expect, it } from 'vitest';
import { Attitude } from '../../../src/scene/signs/attitude.ts';
import { quatOfRpy, type Vec3 } from '../../../src/twin/rotation.ts';
import { drawnSign, legSchema, signFrame } from '../../rigs/signs.ts';

/** Codes of an orientation, rad; null: no reading. */
function turned(place: string, rpy: Vec3 | null): Record<string, number | null> {
  const quat = rpy === null ? null : quatOfRpy(rpy);
  const parts = ['w', 'x', 'y', 'z'].map((part, i) => [
    `${place}.${part}`,
    quat && Math.round(quat[i]! * 1e6),
  ]);
  return Object.fromEntries(parts) as Record<string, number | null>;
}

const leaning = turned('quat.hip', [0.1, -0.2, 0.5]);
const show = (
  quat: string[],
  codes: Record<string, number | null>,
  supportM: number | null = null,
  base = false,
) => {
  const schema = legSchema({ ftf: [], quat, base });
  const { sign, strokes } = drawnSign(Attitude, signFrame(codes, { schema }), { supportM });
  return { ...sign.drawn, lean: sign.lean, strokes };
};

it('is a plane at the lowest foot, with roll and pitch of the body and the feet’s own rings', () => {
  const shown = show(['hip', 'foot'], { ...leaning, ...turned('quat.foot', [0, 0, 0]) });
  expect(shown.planeZ).toBeCloseTo(0);
  expect(shown.lean).toEqual({ roll: expect.closeTo(0.1), pitch: expect.closeTo(-0.2) });
  expect(shown).toMatchObject({ ...shown.lean, feet: ['foot'] });
});

it('has neither plane nor plumb line beside the signs of balance: no circle under the robot that it does not stand on', () => {
  const [alone, beside] = [show(['hip'], leaning), show(['hip'], leaning, 0)];
  expect(beside.planeZ, 'its height is known').toBe(alone.planeZ);
  expect(alone.strokes, 'fan, rim, four ticks; shaft, head, thread and foot').toBe(10);
  expect(beside.strokes).toBe(0);
});

it('is unknown for a robot without IMU and base: nothing is drawn', () => {
  expect(show([], {})).toEqual({ planeZ: null, roll: null, pitch: null, feet: [], strokes: 0, lean: null });
  const dead = turned('quat.hip', null);
  expect(show(['hip'], dead)).toMatchObject({ planeZ: null, roll: null, strokes: 0, lean: { roll: null } });
  expect(show(['hip'], dead, null, true).planeZ, 'but the base says it').toBeCloseTo(0);
});
