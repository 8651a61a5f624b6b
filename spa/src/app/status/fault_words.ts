import type { Fault } from '../../twin/alarms/fault_log.ts';
import { say } from '../text/language.ts';

/** What is wrong: a flag as the robot says it, else in the page's words. `by`: how far off, of a joint off its command. */
export function faultWords({ what, words }: Pick<Fault, 'what' | 'words'>, by = ''): string {
  switch (what) {
    case 'flag':
      return words;
    case 'cur':
      return say().overCurrent;
    case 'temp':
      return say().tooHot;
    case 'apart':
      return say().offCommand(by);
  }
}
