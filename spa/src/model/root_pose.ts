import type { Base, Pose } from '../twin/playback/pose.ts';
import { IDENTITY, type Quat, type Vec3, withoutHeading } from '../twin/rotation.ts';
import { type Imu, rootAttitude } from '../twin/sensors/imus.ts';

/** The pose of a robot's root link in the world: from its odometry, else from its body's IMU, else upright. Readings that are not
 *  finite are ignored. */
export class RootPose {
  #headingLocked = false;
  /** The newest valid base; null while the robot reports none. */
  #base: Base | null = null;
  #lean: Imu | null = null;
  /** world_from_root from the last reading of the body's IMU; null before the first. */
  #leaned: Quat | null = null;

  /** Takes the newest pose. True if the root may have moved. */
  update({ base, lean = null }: Pose): boolean {
    const based = this.#takeBase(base);
    const before = this.#lean?.worldFromSensor ?? null;
    this.#lean = lean;
    return based || (lean?.worldFromSensor?.some((part, i) => part !== before?.[i]) ?? false);
  }

  /** Sets whether the robot always faces along the world's x axis. True if that is a change. */
  lockHeading(locked: boolean): boolean {
    const changed = locked !== this.#headingLocked;
    this.#headingLocked = locked;
    return changed;
  }

  /** world_from_root. `xyz` is null if the robot should stand on its lowest point. `rootTurn` gives a link's rotation for the
   *  joint angles, or null for a link that the model lacks. */
  root(rootTurn: (link: string) => Quat | null): { xyz: Vec3 | null; quat_wxyz: Quat } {
    const { xyz, quat_wxyz } = this.#base ?? { xyz: null, quat_wxyz: this.#attitude(rootTurn) };
    return { xyz, quat_wxyz: this.#headingLocked ? withoutHeading(quat_wxyz) : quat_wxyz };
  }

  /** The orientation from the IMU's last reading; upright without one. */
  #attitude(rootTurn: (link: string) => Quat | null): Quat {
    const imu = this.#lean;
    const rootFromLink = imu === null ? null : imu.link === null ? IDENTITY : rootTurn(imu.link);
    if (imu === null || rootFromLink === null) return IDENTITY;
    this.#leaned = rootAttitude(imu, rootFromLink) ?? this.#leaned;
    return this.#leaned ?? IDENTITY;
  }

  /** Takes a base; one that is not finite is ignored, and the last one is kept. True if the base changed. */
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
