/** Finds and reads elements from inside the page, for engines whose driver does not do it the way Playwright does. */

import type { Json, Role } from './page.ts';

declare global {
  interface Window {
    aimed?: { readonly leave: () => void; readonly landed: () => Landed };
  }
}

export type Query =
  | { readonly testId: string }
  | { readonly role: Role; readonly name?: string; readonly pattern?: { source: string; flags: string } };

export type Act =
  | { readonly do: 'count' | 'text' | 'visible' | 'aim' }
  | { readonly do: 'attribute'; readonly name: string }
  | { readonly do: 'fill'; readonly text: string };

/** The result of the press after the last `aim`: a hit, or a miss that was kept from hitting another element. null in a later
 *  document. */
export const LANDED = '(() => window.aimed?.landed() ?? null)()';
export type Landed = 'hit' | 'missed' | 'nothing yet' | null;

/** An expression that does this in the page and returns JSON; `{ not: why }` requests a retry. */
export function inPage(query: Query, act: Act): string {
  return `(${find.toString()})(${JSON.stringify(query)}, ${JSON.stringify(act)})`;
}

/** Runs in the page, so only names defined in here exist. As in Playwright, a name matches a part of the accessible name,
 *  ignoring case, and hidden elements have no role. */
function find(query: Query, act: Act): Json {
  const implicit: Record<Role, string> = {
    link: 'a[href]',
    button: 'button, input[type=button], input[type=submit], summary',
    heading: 'h1, h2, h3, h4, h5, h6',
    table: 'table',
    row: 'tr',
    rowheader: 'th[scope=row]',
    cell: 'td',
    status: 'output',
    alert: '[role=alert]',
    img: 'img, svg[role=img]',
    tab: '[role=tab]',
  };
  const shown = (element: HTMLElement): boolean => {
    const { width, height } = element.getBoundingClientRect();
    return width > 0 && height > 0 && getComputedStyle(element).visibility === 'visible';
  };
  const spoken = (element: HTMLElement): string => {
    const by = (element.getAttribute('aria-labelledby') ?? '').split(/\s+/).filter((id) => id !== '');
    const said =
      by.map((id) => document.getElementById(id)?.textContent ?? '').join(' ') ||
      element.getAttribute('aria-label') ||
      element.getAttribute('alt') ||
      // biome-ignore lint/performance/useDomNodeTextContent: the name is the readable text
      element.innerText ||
      element.getAttribute('title') ||
      '';
    return said.replace(/\s+/g, ' ').trim();
  };
  const named = (element: HTMLElement): boolean => {
    if (!('role' in query)) return true;
    if (query.pattern !== undefined)
      return new RegExp(query.pattern.source, query.pattern.flags).test(spoken(element));
    return spoken(element)
      .toLowerCase()
      .includes((query.name ?? '').toLowerCase());
  };
  const matches = (): HTMLElement[] => {
    if ('testId' in query) {
      return [...document.querySelectorAll<HTMLElement>(`[data-testid="${CSS.escape(query.testId)}"]`)];
    }
    const selector = `:is(${implicit[query.role]}):not([role]), [role=${query.role}]`;
    return [...document.querySelectorAll<HTMLElement>(selector)].filter(
      (element) =>
        element.closest('[aria-hidden=true], [inert]') === null && shown(element) && named(element),
    );
  };
  /** The page may move between aim and press: an unintended target is not pressed. */
  const watch = (meant: (target: Node) => boolean): void => {
    const kinds = ['pointerdown', 'mousedown', 'pointerup', 'mouseup', 'click'];
    let landed: Landed = 'nothing yet';
    const press = (event: Event): void => {
      if (landed === 'nothing yet')
        landed = event.target instanceof Node && meant(event.target) ? 'hit' : 'missed';
      if (landed === 'hit') return;
      event.stopImmediatePropagation();
      event.preventDefault();
    };
    const leave = (): void => {
      for (const kind of kinds) window.removeEventListener(kind, press, true);
    };
    window.aimed?.leave();
    for (const kind of kinds) window.addEventListener(kind, press, true);
    window.aimed = {
      leave,
      landed: () => {
        if (landed !== 'nothing yet') leave();
        return landed;
      },
    };
  };

  const found = matches();
  if (act.do === 'count') return found.length;
  const [element] = found;
  if (act.do === 'visible') return element !== undefined && shown(element);
  if (element === undefined) return { not: 'there' };
  if (found.length > 1) return { not: `one element but ${found.length}` };
  switch (act.do) {
    case 'text':
      // biome-ignore lint/performance/useDomNodeTextContent: the visible text, not everything in the tree
      return element.innerText.trim(); // WebKit ends a flex row with a line break
    case 'attribute':
      return element.getAttribute(act.name);
    case 'fill': {
      if (!(element instanceof HTMLInputElement || element instanceof HTMLTextAreaElement)) {
        return { not: 'a field to type into' };
      }
      element.focus();
      // bypasses React's own setter, which would take the new value for the old one
      Object.getOwnPropertyDescriptor(Object.getPrototypeOf(element), 'value')?.set?.call(element, act.text);
      element.dispatchEvent(new Event('input', { bubbles: true }));
      element.dispatchEvent(new Event('change', { bubbles: true }));
      return null;
    }
    case 'aim': {
      if (!shown(element)) return { not: 'visible' };
      if (element.matches(':disabled')) return { not: 'enabled' };
      element.scrollIntoView({ block: 'nearest', inline: 'nearest' });
      const { left, top, width, height } = element.getBoundingClientRect();
      const point = { x: Math.round(left + width / 2), y: Math.round(top + height / 2) };
      const hit = document.elementFromPoint(point.x, point.y);
      const label = element.closest('label');
      if (hit === null || !(element.contains(hit) || hit.contains(element) || label?.contains(hit))) {
        return { not: `on top: ${hit?.tagName ?? 'nothing'} is` };
      }
      watch((target) =>
        element.contains(hit) || label?.contains(hit)
          ? matches().some((now) => now.contains(target) || now.closest('label')?.contains(target))
          : target === hit,
      );
      return point;
    }
  }
}
