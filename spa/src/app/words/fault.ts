import type { Fault } from '../../twin/alarms/fault_log.ts';
import { korean, say } from '../text/language.ts';

/** A fault in words: flags use the robot's own words; agent reports and everything else use the page's language. `by`: how far a
 *  joint is from its command, with its unit. */
export function faultWords(
  { what, source, words }: Pick<Fault, 'what' | 'source' | 'words'>,
  by = '',
): string {
  switch (what) {
    case 'flag':
      return edgeWords(source, words);
    case 'apart':
      return say().offCommand(by);
    default:
      return say()[`${what}Fault`];
  }
}

/** The agent's reports about its source, in the page's language. Unknown texts stay as they are. A joint flag with the same words
 *  also stays, because it is the robot's own. */
export function edgeWords(source: string, words: string): string {
  if (source !== 'source' && source !== 'events') return words;
  return korean()?.ofAgentKo(words) ?? words;
}
