import type { AngleUnit } from '../../twin/format.ts';
import { coarseDisplay, type Display, displayOf, formatNumber } from '../../twin/format.ts';
import type { RobotTwin } from '../../twin/robot.ts';

/** How a joint's value of this field is shown; null if the robot does not report it. */
function displayFor(twin: RobotTwin, field: string, joint: string, angle: AngleUnit): Display | null {
  const reported = twin.schema?.field(field);
  if (reported == null || !reported.labels.includes(joint)) return null;
  const unit = twin.schema?.mapping.unit(field, joint) ?? reported.unit;
  return displayOf(unit, angle, reported.scale);
}

/** A joint's newest value with its unit, "1.332 rad"; null if the robot does not report it. */
export function readingWords(twin: RobotTwin, field: string, joint: string, angle: AngleUnit): string | null {
  const display = displayFor(twin, field, joint, angle);
  if (display === null) return null;
  return `${formatNumber(twin.value(field, joint) ?? null, display).trim()} ${display.unit}`;
}

/** How far a joint is off its command now, "0.21 rad"; empty if that is not known. */
export function deviationWords(twin: RobotTwin, joint: string, angle: AngleUnit): string {
  const display = displayFor(twin, 'pos', joint, angle);
  const [ref, pos] = [twin.value('ref', joint) ?? null, twin.value('pos', joint) ?? null];
  if (display === null || ref === null || pos === null) return '';
  return `${formatNumber(Math.abs(ref - pos), coarseDisplay(display)).trim()} ${display.unit}`;
}
