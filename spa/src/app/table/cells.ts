import { type Display, stepsOf, stepsText } from '../../twin/format.ts';

/** A piece of text in the page that is written only when it differs: an unchanged row costs a comparison. */
export class TextCell {
  readonly element: HTMLElement;
  readonly #node: Text;
  #shown = '';

  constructor(element: HTMLElement) {
    this.element = element;
    this.#node = document.createTextNode('');
    element.append(this.#node);
  }

  set(text: string): void {
    if (text === this.#shown) return;
    this.#shown = text;
    this.#node.data = text;
  }
}

/** A number that is not even made into a text again while it would look the same. */
export class NumberCell {
  readonly element: HTMLElement;
  readonly #text: TextCell;
  #old = false;
  #steps = 0;
  #display: Display | null = null;

  constructor(element: HTMLElement) {
    this.element = element;
    this.#text = new TextCell(element);
  }

  /** `display`: the same object as long as it says the same. `old`: the last one known, not the present. */
  set(value: number | null, display: Display, old = false): void {
    if (old !== this.#old) {
      this.#old = old;
      this.element.toggleAttribute('data-old', old);
    }
    const steps = stepsOf(value, display);
    if (display === this.#display && Object.is(steps, this.#steps)) return;
    this.#steps = steps;
    this.#display = display;
    this.#text.set(stepsText(steps, display));
  }
}

/** The same for a `data-` attribute, which the style sheet turns into a sign. */
export class DataMark {
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

export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  className: string,
  text?: string,
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (className !== '') element.className = className;
  if (text !== undefined) element.textContent = text;
  return element;
}

/** Shows a button as pressed or not; the page is touched only when that changes. */
export function press(button: HTMLElement, on: boolean): void {
  const pressed = String(on);
  if (button.getAttribute('aria-pressed') !== pressed) button.setAttribute('aria-pressed', pressed);
}
