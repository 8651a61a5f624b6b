/** Characters that are invisible or change the direction of the text around them, except the plain space. */
const UNSEEN = /(?! )[\p{C}\p{Z}\p{Default_Ignorable_Code_Point}\u2800]/u;
const [NON_JOINER, JOINER, AS_PICTURE] = ['\u200c', '\u200d', '\ufe0f'];
const DIRECTION_MARK = /[\u200e\u200f]/;
/** Letters between which joiners are written: Arabic to Sinhala, Myanmar, Khmer and Mongolian, Arabic presentation forms. */
const JOINED = /[\u0600-\u0dff\u1000-\u109f\u1780-\u18af\ufb50-\ufdff\ufe70-\ufefc]/;
const PICTURE = /[\u2190-\u21ff\u2300-\u23ff\u2600-\u27bf\u2b00-\u2bff\u{1f000}-\u{1faff}]/u;

/** Right-to-left letters and marks. */
export const RIGHT_TO_LEFT =
  /[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc\u{10800}-\u{10fff}\u{1e800}-\u{1efff}]/u;

/** Escapes invisible and direction-changing characters of an untrusted text as `\u{202e}`, so that it can't imitate another text
 *  or reorder its surroundings. They stay where a script uses them: joiners between letters of scripts that need them and in
 *  emoji, and direction marks in a text with right-to-left letters (SPEC §2). Show such a text isolated. */
export function visible(text: string): string {
  if (!UNSEEN.test(text)) return text;
  const isRightToLeft = RIGHT_TO_LEFT.test(text);
  const letters = [...text];
  return letters
    .map((c, i) => {
      const isKept = !UNSEEN.test(c) || (DIRECTION_MARK.test(c) ? isRightToLeft : isWritten(letters, i));
      return isKept ? c : `\\u{${c.codePointAt(0)!.toString(16)}}`;
    })
    .join('');
}

/** Whether the character at this place joins letters or pictures beside it. */
function isWritten(letters: readonly string[], at: number): boolean {
  const [mark, before = '', after = ''] = [letters[at], letters[at - 1], letters[at + 1]];
  if (mark === AS_PICTURE) return PICTURE.test(before);
  if ((mark === NON_JOINER || mark === JOINER) && JOINED.test(before) && JOINED.test(after)) return true;
  const picture = before === AS_PICTURE ? (letters[at - 2] ?? '') : before;
  return mark === JOINER && PICTURE.test(picture) && PICTURE.test(after);
}
