import { expect, it } from 'vitest';
import type { Pose } from '../twin/playback/pose.ts';
import { NO_TURN, ofRpy, type Quat, rpyOf, withoutHeading } from '../twin/rotation.ts';
import type { Imu } from '../twin/sensors/imus.ts';
import { Stance } from './root_pose.ts';

const unturned = () => NO_TURN;
const pose = (more: Partial<Pose>): Pose => ({ joints: new Map(), base: null, ...more });
const lean = (worldFromSensor: Quat | null): Imu => ({
  ...{ site: 'torso', name: 'torso', link: 'chest', linkFromSensor: NO_TURN, xyz: [0, 0, 0] },
  ...{ heading: true, worldFromSensor },
});
const close = (quat: Quat) => quat.map((part) => expect.closeTo(part, 9));

it('is what the robot reports; a report of no numbers or no turn leaves it where it was', () => {
  const stance = new Stance();
  const base = { xyz: [1, 2, 3], quat_wxyz: ofRpy([0, 0, 0.5]) } as const;
  expect(stance.take(pose({ base }))).toBe(true);
  expect(stance.take(pose({ base: { ...base } }))).toBe(false);
  expect(stance.take(pose({ base: { ...base, quat_wxyz: [0, 0, 0, 0] } }))).toBe(false);
  expect(stance.take(pose({ base: { ...base, xyz: [Number.NaN, 0, 0] } }))).toBe(false);
  expect(stance.root(unturned)).toEqual({ xyz: [1, 2, 3], quat_wxyz: close(base.quat_wxyz) });
});

it('is by the body’s IMU where nothing is reported, and stays so when it falls silent', () => {
  const stance = new Stance();
  expect(stance.root(unturned)).toEqual({ xyz: null, quat_wxyz: NO_TURN });
  const leaning = ofRpy([0.2, 0.1, 0.7]);
  expect(stance.take(pose({ lean: lean(leaning) }))).toBe(true);
  const chest = ofRpy([0, 0.3, 0]); // the waist is bent: the root leans otherwise than the chest
  expect(rpyOf(stance.root(() => chest).quat_wxyz)[1]).not.toBeCloseTo(0.1);
  expect(stance.root(unturned)).toEqual({ xyz: null, quat_wxyz: close(leaning) });
  expect(stance.take(pose({ lean: lean(null) }))).toBe(false);
  expect(stance.root(unturned).quat_wxyz).toEqual(close(leaning));
  expect(stance.root(() => null).quat_wxyz, 'on a link that the model does not have').toEqual(NO_TURN);
});

it('with the heading locked faces along x, also while the IMU is silent', () => {
  const stance = new Stance();
  const leaning = ofRpy([0.2, 0.1, 0.7]);
  stance.take(pose({ lean: lean(leaning) }));
  stance.root(unturned);
  stance.take(pose({ lean: lean(null) }));
  expect(stance.lockHeading(true)).toBe(true);
  expect(stance.lockHeading(true)).toBe(false);
  expect(stance.root(unturned).quat_wxyz).toEqual(close(withoutHeading(leaning)));
  stance.lockHeading(false);
  expect(stance.root(unturned).quat_wxyz).toEqual(close(leaning));
});
