import { editsText, NO_EDITS, readEdits, type Threshold, withEdit } from '../twin/limits.ts';
import type { RobotTwin } from '../twin/robot.ts';

/** The thresholds that a person has set, robot by robot. Kept in this browser; nothing of it is ever sent. */
const keyOf = (robot: string) => `posecast.limits.${robot}`;

/** Storage throws in a third-party iframe and in some private windows; then they last as long as the page. */
export function loadOwnLimits(twin: RobotTwin): void {
  try {
    twin.acceptEdits(readEdits(window.localStorage.getItem(keyOf(twin.robot))));
    watch(twin);
  } catch {
    // as above
  }
}

/** null gives the channel back to the profile. */
export function setOwnLimit(
  twin: RobotTwin,
  field: string,
  label: string,
  threshold: Threshold | null,
): void {
  twin.acceptEdits(withEdit(twin.edits, field, label, threshold));
  watch(twin);
  try {
    if (twin.edits.size === 0) window.localStorage.removeItem(keyOf(twin.robot));
    else window.localStorage.setItem(keyOf(twin.robot), editsText(twin.edits));
  } catch {
    // as above
  }
}

/** Only who has set a limit needs it watched here: the edge watches those of the profile. */
function watch(twin: RobotTwin): void {
  if (twin.edits.size === 0) return;
  import('./own_alarms.ts').then(
    ({ watchOwnLimits }) => watchOwnLimits(twin),
    () => {}, // colours still say it
  );
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
