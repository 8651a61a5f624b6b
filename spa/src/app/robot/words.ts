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

/** Why the body is not drawn in full 3D quality. */
export function viewWords(trouble: keyof typeof VIEW_WORDS): string {
  return more()[VIEW_WORDS[trouble]];
}

/** Says that these joints have no reading and are shown at their last known position. Names at most four. */
export function unreadWords(joints: readonly string[]): string {
  return more().noReadingOf(joints.slice(0, 4).map(isolated), Math.max(0, joints.length - 4));
}

/** Says that meshes could not be loaded. `missing`: their URIs, of which at most four are named; `all`: how many meshes the model
 *  has, null if unknown. */
export function missingWords(missing: readonly string[], all: number | null): string {
  const names = missing.map((uri) => (uri.split('/').at(-1) ?? uri).replace(/\.[a-z]+$/i, ''));
  const shown = names.slice(0, 4).map(isolated).join(', ') + (names.length > 4 ? ', …' : '');
  return more().missing(missing.length, all, shown);
}

/** Says that only the skeleton of a body can be shown. `why`: the reason, from outside. */
export function bareWords(why: string): string {
  return more().bare(isolated(why));
}

/** How many findings there are about the model. */
export function remarksWords(count: number): string {
  return more().remarks(count);
}
