/** Reads untrusted XML into small trees with line numbers, which the browser's own parser does not provide. */

const MAX_BYTES = 8 << 20;
const MAX_ELEMENTS = 50_000;
const MAX_DEPTH = 64;
/** Maximum number of namespace prefixes: browsers search all declared ones for each name. */
const MAX_PREFIXES = 1000;
const QUOTED = /"[^"]*"|'[^']*'/g;

/** XML that is refused: a one-line message, and the line number if known. */
export class XmlRefused extends Error {
  readonly line: number | null;

  constructor(reason: string, line: number | null) {
    super(reason);
    this.line = line;
  }
}

export class XmlElement {
  readonly tag: string;
  readonly line: number | null;
  readonly children: readonly XmlElement[];
  readonly #element: Element;

  constructor(element: Element, lines: Iterator<number | null>) {
    this.#element = element;
    this.tag = element.nodeName;
    this.line = lines.next().value ?? null; // in document order: the element before its children
    this.children = [...element.children].map((child) => new XmlElement(child, lines));
  }

  get(name: string): string | null {
    return this.#element.getAttribute(name);
  }

  /** The names of its attributes. */
  get attributes(): readonly string[] {
    return this.#element.getAttributeNames();
  }

  all(tag: string): XmlElement[] {
    return this.children.filter((child) => child.tag === tag);
  }

  first(tag: string): XmlElement | null {
    return this.children.find((child) => child.tag === tag) ?? null;
  }
}

/** Parses XML. Throws XmlRefused; hostile texts are refused before the browser's parser sees them. */
export function readXml(text: string): XmlElement {
  if (text.length > MAX_BYTES) throw new XmlRefused('larger than 8 MiB', null);
  const { lines, declared } = scan(text);
  const xml = new DOMParser().parseFromString(declared, 'text/xml');
  const complaint = xml.querySelector('parsererror')?.textContent;
  if (complaint != null) {
    const line = /line(?: number)?:? (\d+)/i.exec(complaint)?.[1];
    const why = /error on line \d+ at column \d+: ([^\n]*)/
      .exec(complaint)?.[1]
      ?.replace(/Below is a .*/, '');
    throw new XmlRefused(
      `not XML: ${(why ?? complaint.split('\n')[0] ?? '').trim()}`,
      line ? Number(line) : null,
    );
  }
  const count = xml.getElementsByTagName('*').length;
  return new XmlElement(xml.documentElement, (count === lines.length ? lines : []).values());
}

/** A tag. The expression can't backtrack far, because no tag contains another `<` and a name is matched as a whole. */
const TAG = /<(\/?)([^\s/>!?<][^\s/><]*)(?![^\s/><])((?:"[^"<]*"|'[^'<]*'|[^<>"'])*?)(\/?)>/y;
/** Sections without tags (comments and the like), and how each ends. */
const ASIDES = [
  ['<!--', '-->'],
  ['<![CDATA[', ']]>'],
  ['<?', '?>'],
] as const;

/**
 * Returns the line of each start tag in document order, and the text in a form that browsers accept: with all used prefixes
 * declared (the edge reads `xacro:` without its namespace), and without anything after the root. Throws XmlRefused if a limit is
 * exceeded.
 */
function scan(text: string): { lines: number[]; declared: string } {
  const lines: number[] = [];
  const prefixes = new Set<string>();
  const declared = new Set(['xml', 'xmlns']); // prefixes declared on the root; others are not valid everywhere
  const newlines = text.matchAll(/\r\n?|\n/g);
  let line = 1;
  let newline = newlines.next().value?.index ?? text.length;
  let depth = 0;
  let root: number | null = null;
  let end = text.length;
  for (let at = text.indexOf('<'); at >= 0; ) {
    for (; newline < at; newline = newlines.next().value?.index ?? text.length) line += 1;
    if (/^<!(DOCTYPE|ENTITY)/i.test(text.slice(at, at + 10)))
      throw new XmlRefused('a document type (DTD) is not accepted', line);
    const aside = ASIDES.find(([begin]) => text.startsWith(begin, at));
    if (aside !== undefined) {
      const over = text.indexOf(aside[1], at + aside[0].length);
      if (over < 0) break; // unterminated: the browser's parser reports it
      at = text.indexOf('<', over + aside[1].length);
      continue;
    }
    TAG.lastIndex = at;
    const tag = TAG.exec(text);
    at = text.indexOf('<', at + 1);
    if (tag === null) continue;
    const [, closing, name = '', attributes = '', empty] = tag;
    if (closing === '/') {
      depth -= 1;
      if (depth > 0 || root === null) continue;
      end = TAG.lastIndex;
      break;
    }
    const names = `${name} ${attributes.replace(QUOTED, '""')}`; // names only, without values
    if (root === null) {
      root = tag.index + 1 + name.length;
      for (const [, prefix] of names.matchAll(/\sxmlns:([\w.-]+)\s*=/g)) declared.add(prefix!);
    }
    for (const [, prefix] of names.matchAll(/(?:^|\s)([\w.-]+):[\w.-]+/g)) prefixes.add(prefix!);
    if (prefixes.size > MAX_PREFIXES) throw new XmlRefused(`more than ${MAX_PREFIXES} prefixes`, line);
    lines.push(line);
    if (lines.length > MAX_ELEMENTS) throw new XmlRefused(`more than ${MAX_ELEMENTS} elements`, line);
    if (depth >= MAX_DEPTH) throw new XmlRefused(`nested more than ${MAX_DEPTH} deep`, line);
    if (empty !== '/') depth += 1;
    else if (depth === 0) {
      end = TAG.lastIndex;
      break;
    }
  }
  const missing = [...prefixes].filter((prefix) => !declared.has(prefix));
  const more = missing.map((prefix) => ` xmlns:${prefix}="${prefix}"`).join('');
  return { lines, declared: root === null ? text : text.slice(0, root) + more + text.slice(root, end) };
}
