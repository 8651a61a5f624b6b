import { flagWords } from '../../twin/format.ts';
import { createElement } from '../shell/cells.ts';

/** A flag's word, which opens its explanation when pressed. `source`: the joint or sensor that reports it. */
export function FlagTerm({ source, bit }: { source: string; bit: string }) {
  return (
    <button
      type="button"
      className="term"
      data-explain="flag"
      data-source={source}
      data-bit={bit}
      aria-haspopup="dialog"
    >
      {flagWords(bit)}
    </button>
  );
}

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
