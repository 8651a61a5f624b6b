import type { Page } from '../driver/page.ts';

/** The minimum letter size while presenting, as a fraction of the picture's height. */
const LEAST_PART = 0.022;

/** Texts below that size, and parts of the bars that are still visible. */
export function tooSmall(page: Page): Promise<string[]> {
  return page.evaluate<string[]>(`(() => {
    const small = [];
    const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    for (let node = walk.nextNode(); node !== null; node = walk.nextNode()) {
      const element = node.parentElement;
      if (node.data.trim() === '' || element.closest('.unseen, noscript') || !element.checkVisibility({ visibilityProperty: true, opacityProperty: true })) continue;
      const px = parseFloat(getComputedStyle(element).fontSize) * (element.currentCSSZoom ?? 1);
      if (px < ${LEAST_PART} * innerHeight) small.push(px + ' px: ' + node.data.trim());
    }
    for (const bar of document.querySelectorAll('.top, .split-panel, .sheet, .stage-tools, .embed-foot, .stage-note'))
      if (bar.checkVisibility()) small.push('a bar: ' + bar.className);
    return small;
  })()`);
}
