/** Characters that are invisible or change the direction of the text around them, except the plain space. */
const UNSEEN = /(?! )[\p{C}\p{Z}\p{Default_Ignorable_Code_Point}\u2800]/gu;

/** Escapes invisible and direction-changing characters of an untrusted text as `\u{202e}`, so that it can't imitate
 *  another text or reorder its surroundings. */
export function visible(text: string): string {
  return text.replace(UNSEEN, (c) => `\\u{${c.codePointAt(0)!.toString(16)}}`);
}
