import type { RobotLink } from '../state/robot_link.ts';

/** Whether the relay knows the robot. It has no past of a robot that it has not received since it started. */
export function isHeard({ client, twin }: RobotLink): boolean {
  return client.link.phase === 'open' && twin.schema !== null && twin.evidence.status?.seq != null;
}
