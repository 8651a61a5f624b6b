import { korean } from '../text/language.ts';

/** The agent's reports about its source, in the page's language. Unknown texts stay as they are. A joint flag with the same words
 *  also stays, because it is the robot's own. */
export function edgeWords(source: string, words: string): string {
  if (source !== 'source' && source !== 'events') return words;
  return korean()?.ofAgentKo(words) ?? words;
}
