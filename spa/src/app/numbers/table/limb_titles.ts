import { type Limb, limbsOf } from '../../../twin/limbs.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import { more } from '../../text/more.ts';

/** The joints limb by limb, with titles in the language in force. */
export function titledLimbs(schema: NonNullable<RobotTwin['schema']>, tree: RobotTwin['tree']): Limb[] {
  return limbsOf(schema, tree, more());
}
