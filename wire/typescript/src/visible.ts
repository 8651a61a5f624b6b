/** Characters that are invisible or change the direction of the text around them, except the plain space. */
const UNSEEN = /(?! )[\p{C}\p{Z}\p{Default_Ignorable_Code_Point}\u2800]/gu;

/** The same without what Persian, Hindi, Sinhala or Hebrew is written with: joiners and marks of direction (SPEC §2). */
const UNWRITTEN = /(?![ \u200c-\u200f])[\p{C}\p{Z}\p{Default_Ignorable_Code_Point}\u2800]/gu;

/** Escapes invisible and direction-changing characters of an untrusted text as `\u{202e}`, so that it can't imitate
 *  another text or reorder its surroundings. */
export function visible(text: string): string {
  return text.replace(UNSEEN, escaped);
}

/** As `visible`, for texts that people are to read: joiners and direction marks stay. An RLM may still move what stands
 *  beside it: show the text isolated. */
export function readable(text: string): string {
  return text.replace(UNWRITTEN, escaped);
}

function escaped(c: string): string {
  return `\\u{${c.codePointAt(0)!.toString(16)}}`;
}
