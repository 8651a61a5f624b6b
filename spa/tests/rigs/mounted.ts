import { createElement, type FunctionComponent } from 'react';
import { createRoot, type Root } from 'react-dom/client';
import { afterEach, vi } from 'vitest';

/** A late part must be compiled first, on a possibly busy machine. */
const PATIENCE_MS = 20_000;
let root: Root | null = null;

/** Removes the component of `mount`. */
export function unmount(): void {
  root?.unmount();
  root = null;
  document.body.replaceChildren();
}
afterEach(unmount);

/** Shows a component on an empty page, until the end of the test. */
export function mount<P extends object>(component: FunctionComponent<P>, props: P) {
  const host = document.createElement('div');
  document.body.append(host);
  root = createRoot(host);
  root.render(createElement(component, props));
  /** Waits for an element. */
  const find = <E extends HTMLElement = HTMLElement>(selector: string) =>
    vi.waitFor(() => {
      const found = host.querySelector<E>(selector);
      if (found === null) throw new Error(`no ${selector} in ${host.innerHTML.slice(0, 300)}`);
      return found;
    }, PATIENCE_MS);
  return {
    host,
    find,
    findById: <E extends HTMLElement = HTMLElement>(testId: string) => find<E>(`[data-testid="${testId}"]`),
    /** Waits until an element has a text. */
    says: (selector: string, words: string | RegExp) =>
      vi.waitFor(() => {
        const said = host.querySelector(selector)?.textContent ?? '';
        if (!(typeof words === 'string' ? said.includes(words) : words.test(said)))
          throw new Error(`${selector} says ${JSON.stringify(said)}, not ${words}`);
      }, PATIENCE_MS),
  };
}
