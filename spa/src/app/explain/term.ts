import { createElement } from '../numbers/grid/cells.ts';

/** A word that explains itself when it is pressed. `key` as in the catalogue: `columns.pos`; of `units` its text says which. */
export function createTerm(text: string, key: string, className = ''): HTMLButtonElement {
  const term = document.createElement('button');
  term.className = `term ${className}`.trim();
  if (text !== '') term.append(createElement('span', '', text)); // WebKit turns what is in a button, and no button
  term.type = 'button';
  term.dataset.explain = key;
  term.setAttribute('aria-haspopup', 'dialog');
  return term;
}

/** A unit beside a number. It is no stop for the Tab key: what explains its column explains it, too. */
export function createUnit(className = 'unit'): HTMLButtonElement {
  const unit = createTerm('', 'units', className);
  unit.tabIndex = -1;
  return unit;
}
