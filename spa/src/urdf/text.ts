import { foreignTo, ROBOT, wideEncoding } from './content.ts';
import { type Finding, quoted } from './finding.ts';
import { XmlRefused } from './xml.ts';

/**
 * Reads text from untrusted files as the edge does (posecast_edge.model.text): by its byte order mark, then by the encoding that
 * its XML declaration names, then as UTF-8, then as Latin-1, with a finding. Takes a robot's description out of the output of
 * ROS's tools.
 */

/** Encodings as browsers call them, with the labels that files use for them. */
const ENCODINGS: Readonly<Record<string, string>> = {
  'utf-8': 'utf-8 utf8 us-ascii ascii',
  'windows-1250': 'windows-1250 cp1250',
  'windows-1251': 'windows-1251 cp1251',
  'windows-1252': 'windows-1252 cp1252 iso-8859-1 iso8859-1 iso_8859-1 latin1 latin-1 l1',
  'windows-1253': 'windows-1253 cp1253',
  'windows-1254': 'windows-1254 cp1254 iso-8859-9 iso8859-9 latin5',
  'windows-1255': 'windows-1255 cp1255',
  'windows-1256': 'windows-1256 cp1256',
  'windows-1257': 'windows-1257 cp1257',
  'windows-1258': 'windows-1258 cp1258',
  'windows-874': 'windows-874 tis-620 iso-8859-11',
  'iso-8859-2': 'iso-8859-2 iso8859-2 latin2',
  'iso-8859-3': 'iso-8859-3 iso8859-3 latin3',
  'iso-8859-4': 'iso-8859-4 iso8859-4 latin4',
  'iso-8859-5': 'iso-8859-5 iso8859-5 cyrillic',
  'iso-8859-6': 'iso-8859-6 iso8859-6 arabic',
  'iso-8859-7': 'iso-8859-7 iso8859-7 greek',
  'iso-8859-8': 'iso-8859-8 iso8859-8 hebrew',
  'iso-8859-10': 'iso-8859-10 iso8859-10 latin6',
  'iso-8859-13': 'iso-8859-13 iso8859-13',
  'iso-8859-14': 'iso-8859-14 iso8859-14',
  'iso-8859-15': 'iso-8859-15 iso8859-15 latin9',
  'koi8-r': 'koi8-r koi8',
  'koi8-u': 'koi8-u',
  ibm866: 'ibm866 cp866',
  macintosh: 'macintosh x-mac-roman',
  gb18030: 'gb18030 gbk gb2312 gb_2312-80 chinese x-gbk cp936',
  big5: 'big5 big5-hkscs cp950',
  'euc-jp': 'euc-jp x-euc-jp',
  shift_jis: 'shift_jis shift-jis sjis windows-31j ms932 cp932',
  'euc-kr': 'euc-kr ks_c_5601-1987 windows-949 cp949',
};
const NAMES: ReadonlyMap<string, string> = new Map(
  Object.entries(ENCODINGS).flatMap(([name, labels]) => labels.split(' ').map((label) => [label, name])),
);
/** Declarations that can't be read where they are true. */
const UNTRUE: ReadonlySet<string> = new Set(['utf-16', 'utf-16le', 'utf-16be', 'ucs-2']);
const LATIN = 'windows-1252';
/** What Windows has in Latin-1's place for control characters, from U+0080 on. Some engines leave it out. */
const LATIN_80 = '€\x81‚ƒ„…†‡ˆ‰Š‹Œ\x8dŽ\x8f\x90‘’“”•–—˜™š›œ\x9džŸ';
const LATIN_TEXT =
  'a byte that is not UTF-8; the file is read as Latin-1: save it as UTF-8, or declare its encoding in the first line';

const HEAD = 64 << 10; // bytes in which a declaration may begin
const DECLARATION_MAX = 200; // letters
const DECLARED = /\sencoding\s*=\s*["']([\w.:-]{1,40})["']/;
const BLANKS = /[ \t\n\v\f\r]*/y;

/** A file's text without byte order mark and XML declaration, and what was found on the way. */
export interface Text {
  readonly text: string;
  readonly findings: readonly Finding[];
}

/** Decodes a file. Throws XmlRefused if it is broken UTF-16. */
export function readText(bytes: Uint8Array): Text {
  const [a, b, c, d] = bytes;
  if ((a === 0xff && b === 0xfe && c === 0 && d === 0) || (a === 0 && b === 0 && c === 0xfe && d === 0xff))
    throw new XmlRefused('UTF-32 text, which is not supported: save it as UTF-8', null);
  const wide = wideEncoding(bytes);
  if (wide !== null) {
    const text = decodedAs(wide, bytes);
    if (text === null) throw new XmlRefused('broken UTF-16 text: save it as UTF-8', null);
    return { text: withoutDeclaration(text.replace(/^\ufeff/, '')), findings: [] };
  }
  const rest = a === 0xef && b === 0xbb && c === 0xbf ? bytes.subarray(3) : bytes;
  const head = new TextDecoder('latin1').decode(rest.subarray(0, HEAD));
  const [at, end] = declarationIn(head);
  const declared = DECLARED.exec(head.slice(at, end))?.[1] ?? '';
  const name = NAMES.get(declared.toLowerCase());
  const findings: Finding[] = [];
  const say = (text: string, line: number) =>
    findings.push({ severity: 'warning', code: 'encoding', text, line });
  if (name !== undefined && name !== 'utf-8') {
    const text = decodedAs(name, rest);
    if (text !== null) return { text: withoutDeclaration(text), findings };
    say(`its bytes are not what it declares, ${quoted(declared)}`, 1);
  } else if (name === undefined && declared !== '' && !UNTRUE.has(declared.toLowerCase())) {
    say(`the encoding ${quoted(declared)} is not known`, 1);
  }
  const utf8 = decodedAs('utf-8', rest);
  if (utf8 !== null) return { text: withoutDeclaration(utf8), findings };
  const sound = new TextDecoder('utf-8', { ignoreBOM: true }).decode(rest).split('\ufffd', 1)[0]!;
  say(LATIN_TEXT, sound.split('\n').length);
  return { text: withoutDeclaration(decodedAs(LATIN, rest)!), findings };
}

/** The text in an encoding; null if the bytes don't fit. */
export function decodedAs(encoding: string, bytes: Uint8Array): string | null {
  if (encoding === LATIN)
    return new TextDecoder(LATIN)
      .decode(bytes)
      .replace(/[\x80-\x9f]/g, (letter) => LATIN_80[letter.charCodeAt(0) - 0x80]!);
  try {
    return new TextDecoder(encoding, { fatal: true, ignoreBOM: true }).decode(bytes);
  } catch {
    return null;
  }
}

/** Blanks out the XML declaration: it may name another encoding than the text has by now. ROS accepts it after blanks and
 *  comments, which browsers don't. */
function withoutDeclaration(text: string): string {
  const [at, end] = declarationIn(text.slice(0, HEAD));
  return end === 0 ? text : text.slice(0, at) + text.slice(at, end).replace(/[^\n]/g, ' ') + text.slice(end);
}

/** Where the declaration begins and ends; 0 and 0 without one. */
function declarationIn(text: string): [at: number, end: number] {
  let at = 0;
  for (;;) {
    BLANKS.lastIndex = at;
    BLANKS.test(text);
    at = BLANKS.lastIndex;
    if (!text.startsWith('<!--', at)) break;
    const over = text.indexOf('-->', at + 4);
    if (over < 0) return [0, 0];
    at = over + 3;
  }
  const end = text.slice(at, at + DECLARATION_MAX).indexOf('?>');
  return end >= 0 && text.startsWith('<?xml', at) ? [at, at + end + 2] : [0, 0];
}

const PREAMBLE = /^[^<]{1,1000}(?=<(?:\?xml[ \t\n\v\f\r]|!--|robot[ \t\n\v\f\r>]))/;
const QUOTE = /(["'])(?:\\[nrt ]|[ \t\n\v\f\r])*$/;
const ESCAPE = /\\(?:x([0-9A-Fa-f]{2})|u([0-9A-Fa-f]{4})|U([0-9A-Fa-f]{8})|\r?\n[ \t]*|([\s\S]))/g;
const LETTERS: Readonly<Record<string, string>> = {
  ...{ n: '\n', t: '\t', r: '\r', 0: '', a: '', b: '', e: '', f: '', v: '' },
  ...{ N: '\x85', _: '\xa0', L: '\u2028', P: '\u2029' },
};
const CUT_OFF = 'cut off by ros2 topic echo: repeat the command with --full-length';
const LONE = /[\ud800-\udbff](?![\udc00-\udfff])|(?<![\ud800-\udbff])[\udc00-\udfff]/g;

/** Decodes a robot's description, also from the output of `ros2 topic echo` or `ros2 param get`. Throws XmlRefused, which names
 *  the file, if it is no text of a robot at all. */
export function readRobotText(bytes: Uint8Array): Text {
  const foreign = foreignTo(ROBOT, bytes);
  if (foreign !== null) throw new XmlRefused(foreign, null);
  const { text, findings } = readText(bytes);
  const before = PREAMBLE.exec(text.slice(0, 2048))?.[0] ?? '';
  const shown = before.split(/[ \t\n\v\f\r]+/).filter(Boolean);
  if (shown.length === 0) return { text, findings };
  let taken = text.slice(before.length);
  const quote = QUOTE.exec(before)?.[1];
  if (quote === '"') taken = unescaped(taken);
  else if (quote === "'") taken = between(taken, "'").replaceAll("''", "'");
  if (!taken.includes('</robot') && /\.\.\.[ \t\n\v\f\r]*-*[ \t\n\v\f\r]*$/.test(taken.slice(-200)))
    throw new XmlRefused(CUT_OFF, null);
  const note = `the robot's description was taken out behind ${quoted(shown.join(' '), 40)}; lines count from there`;
  const finding: Finding = { severity: 'hint', code: 'taken-out', text: note, line: null };
  return { text: withoutDeclaration(taken), findings: [...findings, finding] };
}

/** Up to the quote that ends it; a doubled one, or one behind a backslash, doesn't. */
function between(text: string, quote: string): string {
  for (let at = text.indexOf(quote); at >= 0; ) {
    if (quote === "'" && text[at + 1] === "'") at = text.indexOf(quote, at + 2);
    else if (quote === '"' && isEscaped(text, at)) at = text.indexOf(quote, at + 1);
    else return text.slice(0, at);
  }
  return text;
}

function isEscaped(text: string, at: number): boolean {
  let back = at;
  while (back > 0 && text[back - 1] === '\\') back -= 1;
  return (at - back) % 2 === 1;
}

/** A string of YAML or JSON in double quotes. */
function unescaped(text: string): string {
  return between(text, '"')
    .replace(ESCAPE, (_, x?: string, u?: string, U?: string, letter?: string) => {
      const digits = x ?? u ?? U;
      if (digits === undefined) return letter === undefined ? '' : (LETTERS[letter] ?? letter);
      const code = Number.parseInt(digits, 16);
      return code < 0x110000 ? String.fromCodePoint(code) : '\ufffd';
    })
    .replace(LONE, '\ufffd');
}
