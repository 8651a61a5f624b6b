/** Changes to three.js's shader texts. They throw if a later three.js no longer has what they look for: a silent miss would draw a
 *  robot without its pose or colours. */

const MAIN = 'void main() {';

/** Puts declarations, and functions, before a shader's `main`. */
export function declare(shader: string, head: string): string {
  return replaceOnce(shader, MAIN, `${head}${MAIN}`);
}

/** Puts code after the `#include` of one of three.js's chunks. */
export function insertAfter(shader: string, chunk: string, code: string): string {
  const include = `#include <${chunk}>`;
  return replaceOnce(shader, include, `${include}\n${code}`);
}

function replaceOnce(shader: string, found: string, by: string): string {
  if (!shader.includes(found)) throw new Error(`three.js's shader has no "${found}"`);
  return shader.replace(found, by);
}
