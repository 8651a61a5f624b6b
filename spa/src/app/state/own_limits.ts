import { readEdits } from '../../twin/limits/limits.ts';
import type { RobotTwin } from '../../twin/robot.ts';

/** The thresholds that a person has set, robot by robot. Kept in this browser; nothing of it is ever sent. */
export const keyOf = (robot: string) => `posecast.limits.${robot}`;

/** Storage throws in a third-party iframe and in some private windows; then they last as long as the page. */
export function loadOwnLimits(twin: RobotTwin): void {
  try {
    twin.acceptEdits(readEdits(window.localStorage.getItem(keyOf(twin.robot))));
    watchOwn(twin);
  } catch {
    // as above
  }
}

/** Only who has set a limit needs it watched here: the edge watches those of the profile. */
export function watchOwn(twin: RobotTwin): void {
  if (twin.edits.size === 0) return;
  import('./own_alarms.ts').then(
    ({ watchOwnLimits }) => watchOwnLimits(twin),
    () => {}, // colours still say it
  );
}
