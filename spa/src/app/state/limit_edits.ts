import { writeStored } from '../../browser/storage.ts';
import { editsText, NO_EDITS, type Threshold, withEdit } from '../../twin/limits/limits.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { keyOf, watchOwn } from './own_limits.ts';

/** null gives the channel back to the profile. */
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

/** All of them back to the profile. */
export function dropOwnLimits(twin: RobotTwin): void {
  twin.acceptEdits(NO_EDITS);
  writeStored(keyOf(twin.robot), null);
}
