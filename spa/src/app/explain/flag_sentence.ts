import { sentenceOf } from '../../twin/alarms/sentence.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { languageTag } from '../text/language.ts';

/** What the robot's profile says of a bit of one of its parts, in the page's language; null where it says nothing. */
export function flagSentence({ schema }: RobotTwin, source: string, bit: string) {
  return sentenceOf(schema, source, bit, languageTag());
}
