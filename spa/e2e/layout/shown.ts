/** Reads the positions of everything shown on a page; `findings.ts` reports the problems. */

import type { Page } from '../driver/page.ts';
import type { Shown } from './findings.ts';

/** Elements in which cut text can be read in full: a title contains it, or opening the element shows it. */
const OPENS = 'tr[data-label], .card, .fault-what, .note-caption button';
/** In the scene, where they follow the robot's limbs. */
const OF_SCENE = '.sign-labels';

/** Everything that the page shows now, in document order. */
export function readShown(page: Page): Promise<Shown[]> {
  return page.evaluate<Shown[]>(COLLECT);
}

const COLLECT = `(() => {
  const root = document.querySelector('dialog[open]') ?? document.body;
  const elements = [...root.querySelectorAll('*')];
  const numbers = new Map(elements.map((element, i) => [element, i]));
  const last = new Map();
  for (const element of elements.toReversed())
    last.set(element, Math.max(numbers.get(element), ...[...element.children].map((child) => last.get(child) ?? -1)));

  const known = new Map();
  const styleOf = (element) => {
    if (!known.has(element)) known.set(element, getComputedStyle(element));
    return known.get(element);
  };
  const box = ({ left, top, right, bottom }) => ({ left, top, right, bottom });
  const both = (a, b) => ({
    left: Math.max(a.left, b.left), top: Math.max(a.top, b.top),
    right: Math.min(a.right, b.right), bottom: Math.min(a.bottom, b.bottom),
  });
  const inside = (element) => {
    const { left, top } = element.getBoundingClientRect();
    const zoom = element.currentCSSZoom ?? 1;
    const [x, y] = [left + element.clientLeft * zoom, top + element.clientTop * zoom];
    return { left: x, top: y, right: x + element.clientWidth * zoom, bottom: y + element.clientHeight * zoom };
  };
  const FAR = 1e6;
  /** The part of an element left visible by its ancestors, and whether the hidden part can be scrolled to. */
  const rooms = new Map();
  const roomOf = (element, itself) => {
    const kept = itself ? rooms.get(element) : undefined;
    const found = kept ?? measureRoom(element, itself);
    if (itself) rooms.set(element, found);
    return found;
  };
  const measureRoom = (element, itself) => {
    let room = { left: -FAR, top: -FAR, right: FAR, bottom: FAR };
    let scrolls = false;
    let position = itself ? 'static' : styleOf(element).position;
    for (let around = itself ? element : element.parentElement; around !== null; around = around.parentElement) {
      if (position === 'fixed') break;
      const style = styleOf(around);
      const held = position !== 'absolute' || style.position !== 'static' || style.transform !== 'none';
      if (!held) continue;
      position = style.position;
      if (around === document.body || around === document.documentElement) continue;
      const [x, y] = [style.overflowX, style.overflowY];
      const hides = inside(around);
      const head = around.scrollTop > 0 ? around.querySelector('thead th') : null;
      if (head !== null && element.closest('thead') === null) hides.top = Math.max(hides.top, head.getBoundingClientRect().bottom);
      if (x !== 'visible') room = both(room, { ...room, left: hides.left, right: hides.right });
      if (y !== 'visible') room = both(room, { ...room, top: hides.top, bottom: hides.bottom });
      scrolls ||= (/auto|scroll/.test(x) && around.scrollWidth > around.clientWidth) || (/auto|scroll/.test(y) && around.scrollHeight > around.clientHeight);
    }
    const page = document.documentElement;
    const window_ = { left: 0, top: 0, right: innerWidth, bottom: innerHeight };
    scrolls ||= page.scrollHeight > innerHeight && styleOf(page).overflowY !== 'hidden' && position !== 'fixed';
    return { room: both(room, window_), scrolls };
  };
  const visible = (element) =>
    element.checkVisibility({ opacityProperty: true, visibilityProperty: true, contentVisibilityAuto: true }) &&
    element.closest('.unseen, ${OF_SCENE}, noscript, [aria-hidden=true] svg') === null;
  const titled = (element, words) => {
    for (let at = element; at !== null && at !== root; at = at.parentElement)
      if ((at.title ?? '').includes(words)) return true;
    return false;
  };
  const place = (element) => {
    const named = element.closest('[data-testid], [class], [id]') ?? element;
    return named.dataset.testid ? '[' + named.dataset.testid + ']' : named.className && typeof named.className === 'string' ? '.' + named.className.split(' ')[0] : named.tagName.toLowerCase();
  };
  const short = (words) => words.trim().replace(/\\s+/g, ' ').replace(/\\d+/g, '0').slice(0, 40);

  const shown = [];
  const add = (kind, element, whole, name, extra = {}) => {
    const { room, scrolls } = roomOf(element, kind === 'text');
    const seen = whole.map((one) => both(one, room)).map((one) => one.right > one.left && one.bottom > one.top ? one : { left: 0, top: 0, right: 0, bottom: 0 });
    shown.push({ kind, name, from: numbers.get(element), to: last.get(element), whole, seen, reachable: scrolls, ...extra });
  };
  for (const element of elements) {
    if (!visible(element)) continue;
    const style = styleOf(element);
    if (element instanceof HTMLElement) {
      const at = box(element.getBoundingClientRect());
      const control = element.matches('a[href], button, input, select, summary, textarea, [role=separator]');
      const painted = !/rgba\\(.*, 0\\)|^transparent$/.test(style.backgroundColor) || style.backgroundImage !== 'none' ||
        (style.borderTopStyle !== 'none' && parseFloat(style.borderTopWidth) > 0 && parseFloat(style.borderLeftWidth) > 0);
      if (at.right - at.left > 1 && at.bottom - at.top > 1) {
        if (control && style.pointerEvents !== 'none')
          add('control', element, [at], place(element) + ' button “' + short(element.getAttribute('aria-label') ?? element.textContent) + '”');
        else if (painted && element !== document.body) add('ground', element, [at], 'the ground of ' + place(element));
      }
      if (element.matches('input[placeholder]') && element.value === '') {
        const pen = document.createElement('canvas').getContext('2d');
        pen.font = style.font;
        const room = element.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight);
        if (pen.measureText(element.placeholder).width > room + 1 && !titled(element, element.placeholder))
          shown.push({ kind: 'text', name: place(element) + ' placeholder “' + element.placeholder + '”', from: numbers.get(element), to: last.get(element), whole: [{ left: 0, top: 0, right: 9, bottom: 9 }], seen: [{ left: 0, top: 0, right: 0, bottom: 0 }], reachable: false });
      }
    }
    for (const node of element.childNodes) {
      if (!(node instanceof Text) || node.data.trim() === '') continue;
      const range = document.createRange();
      range.selectNodeContents(node);
      const size = parseFloat(style.fontSize);
      const lines = [...range.getClientRects()].filter((one) => one.width > 0).map((one) => {
        // letters are shorter than the line height that fonts reserve for them
        const middle = (one.top + one.bottom) / 2;
        const half = Math.min(one.height, 0.8 * size) / 2;
        return { left: one.left, right: one.right, top: middle - half, bottom: middle + half };
      });
      if (lines.length === 0) continue;
      const { scrolls } = roomOf(element, true);
      const reachable = scrolls || titled(element, node.data.trim()) || element.closest('${OPENS}') !== null;
      add('text', element, lines, place(element) + ' “' + short(node.data) + '”', { reachable });
    }
  }
  for (const one of shown.filter(({ kind }) => kind === 'control')) {
    const [at] = one.seen;
    if (at.right - at.left < 8 || at.bottom - at.top < 8) continue;
    const hit = document.elementFromPoint((at.left + at.right) / 2, (at.top + at.bottom) / 2);
    const number = hit === null ? undefined : numbers.get(hit);
    const own = number !== undefined && ((number >= one.from && number <= one.to) || hit.contains(elements[one.from]));
    if (!own && !elements[one.from].matches('.segments input')) one.takenBy = hit === null ? 'nothing' : place(hit);
  }
  return shown;
})()`;
