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
