import { writeStored } from '../../browser/storage.ts';
import { editsText, NO_EDITS, type Threshold, withEdit } from '../../twin/limits.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { keyOf, watchOwn } from './own_limits.ts';

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
