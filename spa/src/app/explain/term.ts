import { createElement } from '../shell/cells.ts';

/** A word that opens its explanation when pressed. `key` as in the catalogue: `columns.pos`; for `units`, the element's text says
 *  which unit. */
export function createTerm(text: string, key: string, className = ''): HTMLButtonElement {
  const term = document.createElement('button');
  term.className = `term ${className}`.trim();
  if (text !== '') term.append(createElement('span', '', text)); // WebKit rotates the content of a button but not the button itself
  term.type = 'button';
  term.dataset.explain = key;
  term.setAttribute('aria-haspopup', 'dialog');
  return term;
}

/** A unit beside a number. The Tab key skips it, because the explanation of its column covers it. */
export function createUnit(className = 'unit'): HTMLButtonElement {
  const unit = createTerm('', 'units', className);
  unit.tabIndex = -1;
  return unit;
}
