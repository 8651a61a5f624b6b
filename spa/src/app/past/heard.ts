import type { RobotLink } from '../state/robot_link.ts';

/** Whether the relay knows the robot: of one that it has not heard since it started it has no past. */
export function isHeard({ client, twin }: RobotLink): boolean {
  return client.link.phase === 'open' && twin.schema !== null && twin.evidence.status?.seq != null;
}
