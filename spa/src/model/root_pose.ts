import type { Base, Pose } from '../twin/playback/pose.ts';
import { IDENTITY, type Quat, type Vec3, withoutHeading } from '../twin/rotation.ts';
import { type Imu, rootAttitude } from '../twin/sensors/imus.ts';

/** Where a robot's root link is in the world, by its odometry, else by its body's IMU, else upright. Readings that are no
 *  numbers are ignored. */
export class RootPose {
  #headingLocked = false;
  /** The newest base that made sense; null while the robot reports none. */
  #base: Base | null = null;
  #lean: Imu | null = null;
  /** world_from_root as the body's IMU last had it; null while it never had a reading. */
  #leaned: Quat | null = null;

  /** Takes the newest pose. True when the root may be elsewhere now. */
  update({ base, lean = null }: Pose): boolean {
    const based = this.#takeBase(base);
    const before = this.#lean?.worldFromSensor ?? null;
    this.#lean = lean;
    return based || (lean?.worldFromSensor?.some((part, i) => part !== before?.[i]) ?? false);
  }

  /** Sets whether the robot faces along the world's x whatever its sensors say. True when that is a change. */
  lockHeading(locked: boolean): boolean {
    const changed = locked !== this.#headingLocked;
    this.#headingLocked = locked;
    return changed;
  }

  /** world_from_root: `xyz` null is "on its lowest point". `rootTurn` says how the joints have a link turned; null for
   *  one that this model does not have. */
  root(rootTurn: (link: string) => Quat | null): { xyz: Vec3 | null; quat_wxyz: Quat } {
    const { xyz, quat_wxyz } = this.#base ?? { xyz: null, quat_wxyz: this.#attitude(rootTurn) };
    return { xyz, quat_wxyz: this.#headingLocked ? withoutHeading(quat_wxyz) : quat_wxyz };
  }

  /** As the body's IMU has it, or last had it; upright without. */
  #attitude(rootTurn: (link: string) => Quat | null): Quat {
    const imu = this.#lean;
    const rootFromLink = imu === null ? null : imu.link === null ? IDENTITY : rootTurn(imu.link);
    if (imu === null || rootFromLink === null) return IDENTITY;
    this.#leaned = rootAttitude(imu, rootFromLink) ?? this.#leaned;
    return this.#leaned ?? IDENTITY;
  }

  /** A base that is not numbers is no base report: the last one stays. */
  #takeBase(base: Base | null): boolean {
    const old = this.#base;
    if (base === null) {
      this.#base = null;
      return old !== null;
    }
    const now = [...base.xyz, ...base.quat_wxyz];
    if (!now.every(Number.isFinite) || Math.hypot(...base.quat_wxyz) < 1e-6) return false;
    if (old !== null && [...old.xyz, ...old.quat_wxyz].every((value, i) => value === now[i])) return false;
    this.#base = base;
    return true;
  }
}
