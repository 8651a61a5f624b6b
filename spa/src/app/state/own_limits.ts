import { readStored } from '../../browser/storage.ts';
import { readEdits } from '../../twin/limits/limits.ts';
import type { RobotTwin } from '../../twin/robot.ts';

/** The thresholds that a person has set, robot by robot. Kept in this browser; nothing of it is ever sent. */
export const keyOf = (robot: string) => `posecast.limits.${robot}`;

export function loadOwnLimits(twin: RobotTwin): void {
  twin.acceptEdits(readEdits(readStored(keyOf(twin.robot))));
  watchOwn(twin);
}

/** Watches the viewer's own limits, if there are any; the edge watches those of the profile. */
export function watchOwn(twin: RobotTwin): void {
  if (twin.edits.size === 0) return;
  import('./own_alarms.ts').then(
    ({ watchOwnLimits }) => watchOwnLimits(twin),
    () => {}, // colours still say it
  );
}
