import type { AngleUnit } from '../../twin/format.ts';
import { displayOf, formatNumber } from '../../twin/format.ts';
import type { RobotTwin } from '../../twin/robot.ts';

/** A joint's newest value with its unit, "1.332 rad"; null if the robot does not report it. */
export function readingWords(twin: RobotTwin, field: string, joint: string, angle: AngleUnit): string | null {
  const reported = twin.schema?.field(field);
  if (reported == null || !reported.labels.includes(joint)) return null;
  const unit = twin.schema?.mapping.unit(field, joint) ?? reported.unit;
  const display = displayOf(unit, angle, reported.scale);
  return `${formatNumber(twin.value(field, joint) ?? null, display).trim()} ${display.unit}`;
}
