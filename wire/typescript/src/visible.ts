/** Characters that are invisible or change the direction of the text around them, except the plain space. */
const UNSEEN = /(?! )[\p{C}\p{Z}\p{Default_Ignorable_Code_Point}\u2800]/gu;

/** Those of UNSEEN that no script is written with: Persian, Hindi, Sinhala and Hebrew need joiners and direction marks (SPEC §2). */
const UNWRITTEN = /(?![ \u200c-\u200f])[\p{C}\p{Z}\p{Default_Ignorable_Code_Point}\u2800]/gu;

/** Escapes invisible and direction-changing characters of an untrusted text as `\u{202e}`, so that it can't imitate
 *  another text or reorder its surroundings. */
export function visible(text: string): string {
  return text.replace(UNSEEN, escaped);
}

/** Escapes like `visible`, but keeps joiners and direction marks, for texts that people read. An RLM may still move what stands
 *  beside it: show the text isolated. */
export function readable(text: string): string {
  return text.replace(UNWRITTEN, escaped);
}

function escaped(c: string): string {
  return `\\u{${c.codePointAt(0)!.toString(16)}}`;
}
