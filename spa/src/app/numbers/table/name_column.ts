import { isolated } from '../../../twin/names.ts';
import { shortenNames } from '../../../twin/short_names.ts';

/** What the column of words keeps when names want its room, CSS px: "compliant", and its padding. */
const WORDS_PX = 66;
/** Names that get this much, CSS px, can be read; where they get less, columns that stand in the card make room. */
const ENOUGH_PX = 96;
/** How many times columns can make room: none, the speeds and torques, the deviations too (`data-crowded`). */
const CROWDED = ['', 'some', 'more'] as const;
/** The column of names is at least this wide, CSS px. */
const LEAST_PX = 52;
/** A letter's width where nothing can be measured, CSS px. */
const LETTER_PX = 7;
/** The weight of a name whose joint has a fault: the widest there is. */
const BOLD = 650;

/** A row's name: the button that shows it, and the joint's whole name as it is shown. */
export interface NameCell {
  readonly button: HTMLElement;
  readonly name: string;
}

/** Makes the joint table's column of names as wide as they need and the panel can give, and shortens what is wider. */
export class NameColumn {
  readonly #table: HTMLTableElement;
  readonly #cells: readonly NameCell[];
  /** What the names shown were made for: the room for them and their font. */
  #madeFor = '';
  #font = '';
  #widths = new Map<string, number>();

  constructor(table: HTMLTableElement, cells: readonly NameCell[]) {
    this.#table = table;
    this.#cells = cells;
  }

  /** Fits the column to the table's room. Call it whenever that has changed; it does nothing if it has not. */
  fit(): void {
    const first = this.#cells[0]?.button;
    const room = this.#table.parentElement?.clientWidth ?? 0;
    if (first === undefined || room === 0) return;
    const { fontSize, fontFamily } = getComputedStyle(first);
    const font = `${BOLD} ${fontSize} ${fontFamily}`;
    const madeFor = `${room} ${font}`;
    if (madeFor === this.#madeFor) return;
    this.#madeFor = madeFor;
    const { paddingLeft, paddingRight } = getComputedStyle(first.parentElement!);
    const padding = (Number.parseFloat(paddingLeft) || 0) + (Number.parseFloat(paddingRight) || 0) + 1;
    const widthOf = this.#measure(font);
    const widest = (texts: readonly string[]) =>
      padding + Math.max(...texts.map((text) => [...text].reduce((sum, letter) => sum + widthOf(letter), 0)));
    const wanted = Math.min(ENOUGH_PX, widest(this.#cells.map(({ name }) => isolated(name))));
    let others = 0;
    for (const crowded of CROWDED) {
      this.#table.dataset.crowded = crowded;
      others = this.#widthOfNumbers();
      if (room - others - WORDS_PX >= wanted) break;
    }
    const most = Math.max(LEAST_PX, room - others - WORDS_PX);
    const shown = shortenNames(
      this.#cells.map(({ name }) => name),
      most - padding,
      widthOf,
    );
    const width = Math.max(LEAST_PX, Math.ceil(widest(shown)));
    this.#table.style.setProperty('--joint-width', `${width}px`);
    this.#table.style.minWidth = `${others + width + WORDS_PX}px`;
    this.#cells.forEach(({ button, name }, i) => {
      const [text, whole] = [isolated(shown[i]!), isolated(name)];
      if (button.textContent === text) return;
      button.textContent = text;
      if (text === whole) button.removeAttribute('aria-label');
      else button.setAttribute('aria-label', whole);
    });
  }

  /** Of the columns between the names and the words, CSS px. */
  #widthOfNumbers(): number {
    const cells = [...this.#table.querySelectorAll<HTMLElement>('thead th')];
    return cells.slice(1, -1).reduce((sum, { offsetWidth }) => sum + offsetWidth, 0);
  }

  /** Widths of single letters, CSS px. */
  #measure(font: string): (letter: string) => number {
    if (font !== this.#font) {
      this.#font = font;
      this.#widths.clear();
    }
    const context = document.createElement('canvas').getContext('2d');
    if (context !== null) context.font = font;
    return (letter) => {
      let width = this.#widths.get(letter);
      if (width === undefined) {
        width = context?.measureText(letter).width ?? LETTER_PX;
        this.#widths.set(letter, width);
      }
      return width;
    };
  }
}
