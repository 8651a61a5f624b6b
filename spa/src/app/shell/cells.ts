import { type Display, stepsOf, stepsText } from '../../twin/format.ts';

/** A text on the page that is written only when it changes; if unchanged, the cost is one comparison. */
export class TextCell {
  readonly #node = new Text();
  #shown = '';

  constructor(element: HTMLElement) {
    element.append(this.#node);
  }

  set(text: string): void {
    if (text === this.#shown) return;
    this.#shown = text;
    this.#node.data = text;
  }
}

/** The same for a `data-` attribute, which the style sheet turns into a symbol. */
export class DataAttribute {
  readonly #element: HTMLElement;
  readonly #name: string;
  #shown: string | null = null;

  constructor(element: HTMLElement, name: string) {
    this.#element = element;
    this.#name = name;
  }

  set(value: string): void {
    if (value === this.#shown) return;
    this.#shown = value;
    this.#element.dataset[this.#name] = value;
  }
}

export function createElement<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  className: string,
  text?: string,
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (className !== '') element.className = className;
  if (text !== undefined) element.textContent = text;
  return element;
}

/** Shows a button as pressed or not; the DOM is written only when that changes. */
export function setPressed(button: HTMLElement, on: boolean): void {
  const pressed = String(on);
  if (button.getAttribute('aria-pressed') !== pressed) button.setAttribute('aria-pressed', pressed);
}

/**
 * The numbers of a table, row by row. The shown values are kept in typed arrays, which are fast to compare, and the DOM is
 * written only where a number will look different.
 */
export class NumberGrid {
  readonly #nodes: readonly Text[];
  /** The shown value in steps of the last digit. */
  readonly #steps: Float64Array;
  /** 1 if the number is the last known one, not the present one. */
  readonly #old: Uint8Array;

  constructor(cells: readonly HTMLElement[]) {
    this.#nodes = cells.map((cell) => cell.appendChild(new Text()));
    this.#steps = new Float64Array(cells.length);
    this.#old = new Uint8Array(cells.length);
    this.forget();
  }

  /** Forgets what is shown, because the same numbers will look different (another unit). */
  forget(): void {
    this.#steps.fill(-0); // an impossible step count, so that everything is written again
  }

  /** Shows a value. `old`: it is the last known value, not the present one. */
  set(at: number, value: number | null, display: Display, old: boolean): void {
    const node = this.#nodes[at]!;
    if (this.#old[at] !== Number(old)) {
      this.#old[at] = Number(old);
      node.parentElement?.toggleAttribute('data-old', old);
    }
    const steps = stepsOf(value, display);
    if (Object.is(steps, this.#steps[at])) return;
    this.#steps[at] = steps;
    node.data = stepsText(steps, display);
  }
}
