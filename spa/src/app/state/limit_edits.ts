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
  try {
    if (twin.edits.size === 0) window.localStorage.removeItem(keyOf(twin.robot));
    else window.localStorage.setItem(keyOf(twin.robot), editsText(twin.edits));
  } catch {
    // they last as long as the page does
  }
}

/** All of them back to the profile. */
export function dropOwnLimits(twin: RobotTwin): void {
  twin.acceptEdits(NO_EDITS);
  try {
    window.localStorage.removeItem(keyOf(twin.robot));
  } catch {
    // as above
  }
}
