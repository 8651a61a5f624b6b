/** Lays a page out at every size, theme and language, in place, and collects all problems. */

import type { Page, Viewport } from '../driver/page.ts';
import { until } from '../driver/until.ts';
import { findWrong } from './findings.ts';
import { readShown } from './shown.ts';

export const SIZES: readonly Viewport[] = [
  { width: 360, height: 640 },
  { width: 390, height: 844 },
  { width: 844, height: 390 },
  { width: 768, height: 1024 },
  { width: 1366, height: 768 },
  { width: 1440, height: 900 },
  { width: 1920, height: 1080 },
  { width: 3840, height: 2160 },
];

/** Both languages and both themes. */
export const LOOKS = [
  ['en', 'dark'],
  ['ko', 'light'],
] as const;
const LONGEST_MS = 1000;
const MOST_LOOKS = 4;

export type Language = (typeof LOOKS)[number][0];

/** Problem → where: sizes, languages and the page's content. */
export class Wrongs {
  readonly #found = new Map<string, Set<string>>();

  add(wrong: readonly string[], where: string): void {
    for (const one of wrong) {
      const places = this.#found.get(one) ?? new Set();
      this.#found.set(one, places.add(where));
    }
  }

  /** One line each, with where it was seen. */
  get lines(): string[] {
    return [...this.#found].map(([wrong, places]) => `${wrong} — ${[...places].join(', ')}`);
  }
}

/** Checks the page at every size, in both languages and themes. `what`: its content; `prepare` is called after each change of
 *  language. */
export async function lookEverywhere(
  page: Page,
  what: string,
  wrongs: Wrongs,
  sizes: readonly Viewport[],
  prepare: (language: Language) => Promise<void> = async () => {},
): Promise<void> {
  for (const [language, theme] of LOOKS) {
    await page.viewport(sizes[0]!);
    await showIn(page, language, theme);
    await prepare(language);
    for (const size of sizes) {
      await page.viewport(size);
      wrongs.add(await findLasting(page), `${what} ${size.width}×${size.height} ${language} ${theme}`);
    }
  }
}

/** Applies language and theme the way a link does, without a reload; presenting continues. Retries if needed: the page writes its
 *  address itself, and on a busy machine may do so before it has read the new one. */
export async function showIn(page: Page, language: Language, theme: string): Promise<void> {
  const inForce = () =>
    page.evaluate<boolean>(
      `document.documentElement.lang === '${language}' && document.documentElement.dataset.theme === '${theme}'`,
    );
  await until(
    `${language} ${theme}`,
    async () => {
      await page.evaluate(
        `(() => { location.hash = location.hash.split('?')[0] + '?language=${language}&theme=${theme}' + (/[?&]present/.test(location.hash) ? '&present' : ''); })()`,
      );
      return until('in force', inForce, 3000).catch(() => false);
    },
    60_000,
  );
}

/** Problems that remain when the page has had more time: a busy machine may be late. */
async function findLasting(page: Page): Promise<string[]> {
  const look = async () => {
    await comesToRest(page);
    return findWrong(await readShown(page));
  };
  let lasting = await look();
  for (let i = 1; i < MOST_LOOKS && lasting.length > 0; i += 1) {
    const wrong = await look();
    lasting = lasting.filter((one) => wrong.includes(one));
  }
  return lasting;
}

/** Waits until no control, note or panel has moved for some pictures, at most a second. */
function comesToRest(page: Page): Promise<null> {
  return page.evaluate<null>(`new Promise((done) => {
    const begunMs = performance.now();
    let before = '', same = 0;
    const look = () => {
      const places = [...document.querySelectorAll('button, a, p, [data-testid]')].map((element) => {
        const { x, y, width, height } = element.getBoundingClientRect();
        return [x, y, width, height].map(Math.round).join();
      }).join(' ');
      same = places === before ? same + 1 : 0;
      before = places;
      if ((same >= 3 && performance.now() - begunMs > 250) || performance.now() - begunMs > ${LONGEST_MS}) done(null);
      else requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
  })`);
}
