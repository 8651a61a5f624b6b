import { isolated } from '../../twin/names.ts';
import { more } from '../text/more.ts';

/** Sentences about the picture of a body. */

const VIEW_WORDS = {
  lost: 'viewLost',
  pixels: 'viewPixels',
  detail: 'viewDetail',
  light: 'viewLight',
  'light-pixels': 'viewLightPixels',
  slow: 'viewSlow',
  'given-up': 'viewGivenUp',
  chosen: 'viewChosen',
} as const;

/** How the body is drawn, when that is not as one would expect. */
export function viewWords(trouble: keyof typeof VIEW_WORDS): string {
  return more()[VIEW_WORDS[trouble]];
}

/** Of joints that stand where they did when they were last read. */
export function unreadWords(joints: readonly string[]): string {
  return more().noReadingOf(joints.slice(0, 4).map(isolated), Math.max(0, joints.length - 4));
}

export function missingWords(missing: readonly string[], all: number | null): string {
  const names = missing.map((uri) => (uri.split('/').at(-1) ?? uri).replace(/\.[a-z]+$/i, ''));
  const shown = names.slice(0, 4).map(isolated).join(', ') + (names.length > 4 ? ', …' : '');
  return more().missing(missing.length, all, shown);
}

/** Under a body of which only the bones could be had. */
export function bareWords(why: string): string {
  return more().bare(isolated(why));
}

export function remarksWords(count: number): string {
  return more().remarks(count);
}
