import { expect, it } from 'vitest';
import { RootPose } from '../../src/model/articulated_body.ts';
import type { Pose } from '../../src/twin/playback/pose.ts';
import { NO_JOINTS } from '../../src/twin/playback/pose.ts';
import { IDENTITY, type Quat, quatOfRpy, rpyOf, withoutHeading } from '../../src/twin/rotation.ts';
import type { Imu } from '../../src/twin/sensors/imus.ts';

const unturned = () => IDENTITY;
const pose = (more: Partial<Pose>): Pose => ({ joints: NO_JOINTS, base: null, ...more });
const lean = (worldFromSensor: Quat | null): Imu => ({
  ...{ site: 'torso', name: 'torso', link: 'chest', linkFromSensor: IDENTITY, xyz: [0, 0, 0] },
  ...{ heading: true, worldFromSensor },
});
const close = (quat: Quat) => quat.map((part) => expect.closeTo(part, 9));

it('is what the robot reports; a report of no numbers or no turn leaves it where it was', () => {
  const rootPose = new RootPose();
  const base = { xyz: [1, 2, 3], quat_wxyz: quatOfRpy([0, 0, 0.5]) } as const;
  expect(rootPose.update(pose({ base }))).toBe(true);
  expect(rootPose.update(pose({ base: { ...base } }))).toBe(false);
  expect(rootPose.update(pose({ base: { ...base, quat_wxyz: [0, 0, 0, 0] } }))).toBe(false);
  expect(rootPose.update(pose({ base: { ...base, xyz: [Number.NaN, 0, 0] } }))).toBe(false);
  expect(rootPose.root(unturned)).toEqual({ xyz: [1, 2, 3], quat_wxyz: close(base.quat_wxyz) });
});

it('is by the body’s IMU where nothing is reported, and stays so when it falls silent', () => {
  const rootPose = new RootPose();
  expect(rootPose.root(unturned)).toEqual({ xyz: null, quat_wxyz: IDENTITY });
  const leaning = quatOfRpy([0.2, 0.1, 0.7]);
  expect(rootPose.update(pose({ lean: lean(leaning) }))).toBe(true);
  const chest = quatOfRpy([0, 0.3, 0]); // the waist is bent, so the root leans differently from the chest
  expect(rpyOf(rootPose.root(() => chest).quat_wxyz)[1]).not.toBeCloseTo(0.1);
  expect(rootPose.root(unturned)).toEqual({ xyz: null, quat_wxyz: close(leaning) });
  expect(rootPose.update(pose({ lean: lean(null) }))).toBe(false);
  expect(rootPose.root(unturned).quat_wxyz).toEqual(close(leaning));
  expect(rootPose.root(() => null).quat_wxyz, 'on a link that the model does not have').toEqual(IDENTITY);
});

it('with the heading locked faces along x, also while the IMU is silent', () => {
  const rootPose = new RootPose();
  const leaning = quatOfRpy([0.2, 0.1, 0.7]);
  rootPose.update(pose({ lean: lean(leaning) }));
  rootPose.root(unturned);
  rootPose.update(pose({ lean: lean(null) }));
  expect(rootPose.lockHeading(true)).toBe(true);
  expect(rootPose.lockHeading(true)).toBe(false);
  expect(rootPose.root(unturned).quat_wxyz).toEqual(close(withoutHeading(leaning)));
  rootPose.lockHeading(false);
  expect(rootPose.root(unturned).quat_wxyz).toEqual(close(leaning));
});
