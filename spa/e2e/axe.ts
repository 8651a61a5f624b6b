/** Automated accessibility checks: https://github.com/dequelabs/axe-core */

import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import type { Page } from './driver/page.ts';

const AXE = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

/** One line for each element that axe reports, in the current document. */
export async function violations(page: Page): Promise<string[]> {
  // Half a megabyte: injected once per document.
  if (!(await page.evaluate<boolean>('"axe" in window')))
    await page.evaluate(`(() => { ${AXE}; return true })()`);
  return page.evaluate<
    string[]
  >(`axe.run(document, { resultTypes: ['violations'], preload: false, elementRef: false })
    .then(({ violations }) => violations.flatMap(({ id, nodes }) =>
      nodes.map((node) => id + ': ' + node.target.join(' ') + ' ' + node.failureSummary.replace(/\\s+/g, ' '))))`);
}
