import { type Limb, limbsOf } from '../../../twin/limbs.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import { more } from '../../text/more.ts';

/** The joints by limb, with titles in the current language. */
export function titledLimbs(schema: NonNullable<RobotTwin['schema']>, tree: RobotTwin['tree']): Limb[] {
  return limbsOf(schema, tree, more());
}
