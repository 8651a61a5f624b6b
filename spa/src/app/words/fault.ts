import type { Fault } from '../../twin/alarms/fault_log.ts';
import { say } from '../text/language.ts';
import { edgeWords } from './edge_words.ts';

/** A fault in words: flags use the robot's own words; agent reports and everything else use the page's language. `by`: how far a
 *  joint is from its command, with its unit. */
export function faultWords(
  { what, source, words }: Pick<Fault, 'what' | 'source' | 'words'>,
  by = '',
): string {
  switch (what) {
    case 'flag':
      return edgeWords(source, words);
    case 'cur':
      return say().overCurrent;
    case 'temp':
      return say().tooHot;
    case 'apart':
      return say().offCommand(by);
  }
}
