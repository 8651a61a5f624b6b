/** What the body looks like at one instant: URDF joints (rad, or m for sliding ones) and where the root link is. */
export interface Pose {
  joints: ReadonlyMap<string, number>;
  /** world_from_root, metres and a unit quaternion; null when the robot reports no base: the scene stands it on the floor. */
  base: { xyz: [number, number, number]; quat_wxyz: [number, number, number, number] } | null;
}
