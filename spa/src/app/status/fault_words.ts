import type { Fault } from '../../twin/alarms/fault_log.ts';
import { say } from '../text/language.ts';

/** What a fault is, in words: a flag as the robot names it, others in the page's language. `by`: how far a joint is from
 *  its command, with its unit. */
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
