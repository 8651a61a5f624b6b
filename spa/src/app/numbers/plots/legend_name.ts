/** Where a name may wrap: behind the marks between its words, and before a capital. */
const WORD_ENDS = /[_./:-]+(?=[^_./:\s-])|\p{Ll}(?=\p{Lu})/gu;

/** Shows a name that wraps between its words alone: "left_", "hip_", "pitch". Where it finds no room all the same, a tap
 *  shows it whole, and so does the mouse that rests on it. */
export function writeLegendName(element: HTMLElement, name: string): void {
  element.title = name;
  for (const word of name.replace(WORD_ENDS, '$&\n').split('\n'))
    element.append(word, document.createElement('wbr'));
  element.addEventListener('click', () => element.toggleAttribute('data-whole'));
}
