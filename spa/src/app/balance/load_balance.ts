import { LatePart } from '../../browser/late_part.ts';
import { couldStand } from '../../twin/balance/told/could_stand.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { settings } from '../state/settings.ts';

/** What tells of balance; only for robots that may stand, and for who asks. */
export const BALANCE = new LatePart(
  () => import('./balance_part.ts'),
  () => false,
);

/** Whether a robot's balance may have to be told: its model says whether it is. */
export function mayTell({ twin }: RobotLink): boolean {
  const { balance } = settings();
  return balance === 'on' || (balance === 'auto' && couldStand(twin.schema));
}
