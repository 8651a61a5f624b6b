/** Where a name may wrap: after separators and before a capital. */
const WORD_ENDS = /[_./:-]+(?=[^_./:\s-])|\p{Ll}(?=\p{Lu})/gu;

/** Shows a name that wraps only between its words: "left_", "hip_", "pitch". If it still doesn't fit, a tap or mouse hover shows
 *  the full name. */
export function writeLegendName(element: HTMLElement, name: string): void {
  element.title = name;
  for (const word of name.replace(WORD_ENDS, '$&\n').split('\n'))
    element.append(word, document.createElement('wbr'));
  element.addEventListener('click', () => element.toggleAttribute('data-whole'));
}
