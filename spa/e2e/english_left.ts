/** Finds English text on a page that should use another language. */

import type { Page } from './driver/page.ts';

/** The same in every language: the four states, units, formats, names of things and of keys. */
const SAME = new Set(
  `live holding stale offline posecast hz ms rad deg min kb mb px json csv zip urdf xacro html iframe url qr http https
  websocket esc escape tab enter shift imu ft can pwm cpu mesh roll pitch yaw english language korean fx fy fz mx my mz
  config wx wy wz ax ay az nm csv gib mib sdf mjcf`.split(/\s+/),
);

/** Words of two or more letters that are visible or announced and not in `known` (the robot's own names, lower case): "word: the
 *  sentence that contains it". Code for copying is skipped. */
export async function englishLeft(page: Page, known: ReadonlySet<string>): Promise<string[]> {
  const said = await page.evaluate<string[]>(`(() => {
    const said = new Set();
    const shown = (element) => element.checkVisibility({ visibilityProperty: true }) && !element.closest('pre, code, .brand, .sign-label b');
    const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_ELEMENT | NodeFilter.SHOW_TEXT);
    for (let node = walk.nextNode(); node !== null; node = walk.nextNode()) {
      if (node instanceof Text) {
        if (node.data.trim() !== '' && shown(node.parentElement)) said.add(node.data.trim());
        continue;
      }
      if (!shown(node)) continue;
      for (const name of ['aria-label', 'title', 'placeholder', 'alt', 'aria-description'])
        if (node.hasAttribute(name)) said.add(node.getAttribute(name));
    }
    return [...said];
  })()`);
  return said.flatMap((text) => {
    const words = wordsOf(text.replace(/\bhttps?:\/\/\S+|\b127\.0\.0\.1\S*|#\/\S*/g, ' '));
    const left = words.filter((word) => !SAME.has(word) && !known.has(word));
    return left.length === 0 ? [] : [`${[...new Set(left)].join(' ')}: ${text.slice(0, 120)}`];
  });
}

/** In lower case; "pwmSaturated" is two, "LF1" is one. */
export function wordsOf(text: string): string[] {
  const parted = text.replace(/([a-z])([A-Z])/g, '$1 $2');
  return (parted.match(/[A-Za-z]{2,}\d*/g) ?? []).map((word) => word.toLowerCase());
}
