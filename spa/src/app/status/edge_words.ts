import { more } from '../text/more.ts';

/** What agents report about their sources, and the sentence for it. */
const KNOWN: ReadonlyMap<string, 'agentSilent' | 'agentTooLarge'> = new Map([
  ['silent', 'agentSilent'],
  ["robot's samples are too large", 'agentTooLarge'],
]);

/** What an agent reports about its source, in the page's language. Texts that are not known stay as they are, and so do
 *  the same words of a joint's flag, which are the robot's own. */
export function edgeWords(source: string, words: string): string {
  if (source !== 'source' && source !== 'events') return words;
  const key = KNOWN.get(words);
  if (key !== undefined) return more()[key];
  const count = /^(\d+) more$/.exec(words)?.[1];
  return count === undefined ? words : more().moreEvents(count);
}
