import { LatePart } from '../../browser/late_part.ts';
import { readStored, writeStored } from '../../browser/storage.ts';
import { editsText, NO_EDITS, readEdits, type Threshold, withEdit } from '../../twin/limits.ts';
import type { RobotTwin } from '../../twin/robot.ts';

const OWN_ALARMS = new LatePart(
  () => import('./own_alarms.ts'),
  () => false, // loaded only for viewers with their own thresholds
);

/** The storage key of the viewer's own thresholds for a robot. They stay in this browser and are never sent. */
export const keyOf = (robot: string) => `posecast.limits.${robot}`;

/** Reads the viewer's own thresholds for a robot from the browser's storage, applies them and watches them. */
export function loadOwnLimits(twin: RobotTwin): void {
  twin.acceptEdits(readEdits(readStored(keyOf(twin.robot))));
  watchOwn(twin);
}

/** Watches the viewer's own limits, if there are any. The code for it is loaded first. Limits of the profile are watched
 *  by the edge. */
export function watchOwn(twin: RobotTwin): void {
  if (twin.edits.size === 0) return;
  void OWN_ALARMS.load().then(({ watchOwnLimits }) => watchOwnLimits(twin));
}

/** Sets the viewer's own threshold for a channel, in the channel's unit, and stores it in the browser. null removes it,
 *  so that the profile's limit applies again. */
export function setOwnLimit(
  twin: RobotTwin,
  field: string,
  label: string,
  threshold: Threshold | null,
): void {
  twin.acceptEdits(withEdit(twin.edits, field, label, threshold));
  watchOwn(twin);
  writeStored(keyOf(twin.robot), twin.edits.size === 0 ? null : editsText(twin.edits));
}

/** Removes all of the viewer's own thresholds for a robot, so that the profile's limits apply again. */
export function dropOwnLimits(twin: RobotTwin): void {
  twin.acceptEdits(NO_EDITS);
  writeStored(keyOf(twin.robot), null);
}
