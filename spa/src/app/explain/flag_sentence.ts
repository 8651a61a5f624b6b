import { sentenceOf } from '../../twin/alarms/sentence.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { languageTag } from '../text/language.ts';

/** The robot profile's description of one flag bit of a joint or sensor, in the page's language; null if the profile has none. */
export function flagSentence({ schema }: RobotTwin, source: string, bit: string) {
  return sentenceOf(schema, source, bit, languageTag());
}
