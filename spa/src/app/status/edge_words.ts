import { korean } from '../text/language.ts';

/** What an agent reports about its source, in the page's language. Texts that are not known stay as they are, and so do
 *  the same words of a joint's flag, which are the robot's own. */
export function edgeWords(source: string, words: string): string {
  if (source !== 'source' && source !== 'events') return words;
  return korean()?.ofAgentKo(words) ?? words;
}
