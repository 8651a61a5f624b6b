/** What nobody sees, or what turns the direction of what stands beside it; a space apart. */
const UNSEEN = /(?! )[\p{C}\p{Z}\p{Default_Ignorable_Code_Point}\u2800]/gu;

/** A stranger's text with `\u{202e}` instead of each such character: it looks like no other, and moves no neighbour. */
export function visible(text: string): string {
  return text.replace(UNSEEN, (c) => `\\u{${c.codePointAt(0)!.toString(16)}}`);
}
