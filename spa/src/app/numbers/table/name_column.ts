import { type Limb, limbsOf } from '../../../twin/limbs.ts';
import { alone, isolated } from '../../../twin/names.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import { shortenNames } from '../../../twin/short_names.ts';
import { more } from '../../text/language.ts';

/** The minimum width of the word column when names need room, CSS px: "compliant" plus padding. */
const WORDS_PX = 66;
/** Names with at least this width, CSS px, are readable; if they get less, columns that the card also shows are hidden. */
const ENOUGH_PX = 96;
/** The steps in which columns are hidden: none, then speeds and torques, then deviations as well (`data-crowded`). */
const CROWDED = ['', 'some', 'more'] as const;
/** The minimum width of the name column, CSS px. */
const LEAST_PX = 52;
/** A letter's width if text can't be measured, CSS px. */
const LETTER_PX = 7;
/** The font weight of a faulty joint's name, which is the widest. */
const BOLD = 650;

/** A row's name: the button that shows it, and the joint's full display name. */
export interface NameCell {
  readonly button: HTMLElement;
  readonly name: string;
}

/** Makes the name column of the joint table as wide as the names need and the panel allows, and shortens names that are wider. */
export class NameColumn {
  readonly #table: HTMLTableElement;
  readonly #cells: readonly NameCell[];
  /** The inputs of the shown names: the available width and the font. */
  #madeFor = '';
  #font = '';
  #widthOf = letterWidths('');

  constructor(table: HTMLTableElement, cells: readonly NameCell[]) {
    this.#table = table;
    this.#cells = cells;
  }

  /** Fits the column to the table's room. Call it whenever the room may have changed; otherwise it does nothing. */
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
    if (font !== this.#font) this.#widthOf = letterWidths(font);
    this.#font = font;
    const widthOf = this.#widthOf;
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
      const [text, whole] = [alone(shown[i]!), isolated(name)];
      if (button.textContent === text) return;
      button.textContent = text;
      if (text === whole) button.removeAttribute('aria-label');
      else button.setAttribute('aria-label', whole);
    });
  }

  /** The width of the columns between the names and the words, CSS px. */
  #widthOfNumbers(): number {
    const cells = [...this.#table.querySelectorAll<HTMLElement>('thead th')];
    return cells.slice(1, -1).reduce((sum, { offsetWidth }) => sum + offsetWidth, 0);
  }
}

/** Returns the width of a single letter in this CSS font, CSS px. */
export function letterWidths(font: string): (letter: string) => number {
  const context = document.createElement('canvas').getContext('2d');
  if (context !== null) context.font = font;
  const widths = new Map<string, number>();
  return (letter) => {
    let width = widths.get(letter);
    if (width === undefined) {
      width = context?.measureText(letter).width ?? LETTER_PX;
      widths.set(letter, width);
    }
    return width;
  };
}

/** The joints by limb, with titles in the current language. */
export function titledLimbs(schema: NonNullable<RobotTwin['schema']>, tree: RobotTwin['tree']): Limb[] {
  return limbsOf(schema, tree, more());
}
