/** The build's changes to three.js's shader texts: pure functions, independent of Vite and three.js. */

/** What is known about macros at build time: a number, or null for one that is never defined. */
export type KnownMacros = ReadonlyMap<string, number | null>;

/** Removes comments, empty lines and needless spaces. Directives and `#pragma` keep their lines. */
export function withoutSpaces(glsl: string): string {
  const lines = glsl
    .replace(/\/\*[\s\S]*?\*\//g, ' ')
    .replace(/\/\/[^\n]*/g, '')
    .split('\n')
    .map((line) => line.trim().replace(/\s+/g, ' '))
    .filter((line) => line !== '');
  let text = '';
  for (const line of lines) {
    if (line.startsWith('#')) {
      text += `${text === '' || text.endsWith('\n') ? '' : '\n'}${line}\n`;
      continue;
    }
    // `- -x` must not become `--x`.
    const tight = line
      .replace(/ ?([*/=<>!&|?:;,()[\]{}]) ?/g, '$1')
      .replace(/(?<![-+]) ([-+]) (?![-+])/g, '$1');
    text += /\w$/.test(text) && /^\w/.test(tight) ? ` ${tight}` : tight;
  }
  // The scene and three.js search for this line to insert something before it.
  return text.replace(/void main\(\)\{/g, '\nvoid main() {\n');
}

/** Removes the branches of `#if`, `#ifdef` and `#ifndef` that known macros decide. Throws Error if the directives are
 *  unbalanced. */
export function withoutDeadBranches(glsl: string, known: KnownMacros): string {
  const kept: string[] = [];
  const open: OpenIf[] = [];
  const alive = () => open.every(({ branch }) => branch);
  for (const line of glsl.split('\n')) {
    const [, directive, rest = ''] = /^\s*#\s*(if|ifdef|ifndef|elif|else|endif)\b(.*)$/.exec(line) ?? [];
    if (directive === undefined) {
      if (alive()) kept.push(line);
      continue;
    }
    if (directive === 'if' || directive === 'ifdef' || directive === 'ifndef') {
      const test = decide(conditionOf(directive, rest), known);
      const outside = alive();
      open.push({ written: false, over: test === true, branch: test !== false });
      if (!outside || typeof test === 'boolean') continue;
      open.at(-1)!.written = true;
      kept.push(directive === 'if' ? `#if ${print(test)}` : line);
      continue;
    }
    const at = open.at(-1);
    if (at === undefined) throw new Error(`#${directive} without #if`);
    if (directive === 'endif') {
      open.pop();
      if (at.written && alive()) kept.push(line);
      continue;
    }
    const test = at.over ? false : directive === 'else' ? true : decide(conditionOf('if', rest), known);
    at.branch = test !== false;
    if (test === false) continue;
    const outside = open.slice(0, -1).every(({ branch }) => branch);
    if (test === true) {
      at.over = true;
      if (at.written && outside) kept.push('#else');
    } else if (outside) {
      kept.push(`#${at.written ? 'elif' : 'if'} ${print(test)}`);
      at.written = true;
    }
  }
  if (open.length > 0) throw new Error('#if without #endif');
  return kept.join('\n');
}

/** The names of all functions defined in a text, each with its whole definition. */
export function functionsIn(glsl: string): Map<string, string[]> {
  const found = new Map<string, string[]>();
  for (const match of glsl.matchAll(/^[ \t]*(?:highp )?\w+[ \t]+(\w+)[ \t]*\([^()]*\)[ \t\n]*\{/gm)) {
    const name = match[1]!;
    let depth = 1;
    let end = match.index + match[0].length;
    for (; depth > 0 && end < glsl.length; end += 1) depth += { '{': 1, '}': -1 }[glsl[end]!] ?? 0;
    found.set(name, [...(found.get(name) ?? []), glsl.slice(match.index, end)]);
  }
  return found;
}

interface OpenIf {
  /** Whether its `#if` is kept in the result. */
  written: boolean;
  /** Whether a branch was certain, so that later ones are dead. */
  over: boolean;
  /** Whether the current branch may be compiled. */
  branch: boolean;
}

type Test =
  | boolean
  | { readonly word: string }
  | { readonly not: Test }
  | { readonly left: Test; readonly sign: '&&' | '||'; readonly right: Test };

function conditionOf(directive: string, rest: string): string {
  if (directive === 'if') return rest.replace(/\/\/.*$/, '');
  const defined = `defined( ${rest.trim().split(/\s/)[0]} )`;
  return directive === 'ifdef' ? defined : `! ${defined}`;
}

/** Evaluates a condition as far as possible. Terms are `defined( NAME )` and comparisons. */
function decide(condition: string, known: KnownMacros): Test {
  const tokens =
    condition.match(
      /defined\s*\(\s*\w+\s*\)|defined\s+\w+|\w+\s*(?:[<>]=?|[=!]=)\s*\w+|\w+|&&|\|\||!|[()]/g,
    ) ?? [];
  const bare = (text: string) => text.replace(/\s/g, '');
  const refuse = (): never => {
    throw new Error(`#if ${condition.trim()}: not understood`);
  };
  if (bare(tokens.join('')) !== bare(condition)) refuse();
  let at = 0;
  const or = (): Test => {
    let left = and();
    while (tokens[at] === '||') {
      at += 1;
      left = joined(left, '||', and());
    }
    return left;
  };
  const and = (): Test => {
    let left = unit();
    while (tokens[at] === '&&') {
      at += 1;
      left = joined(left, '&&', unit());
    }
    return left;
  };
  const unit = (): Test => {
    const token = tokens[at++];
    if (token === '!') {
      const test = unit();
      return typeof test === 'boolean' ? !test : { not: test };
    }
    if (token === '(') {
      const test = or();
      return tokens[at++] === ')' ? test : refuse();
    }
    return token === undefined || !/^\w/.test(token) || token === 'defined' ? refuse() : wordOf(token, known);
  };
  const test = or();
  return at === tokens.length ? test : refuse();
}

function wordOf(word: string, known: KnownMacros): Test {
  const name = /^defined\s*\(?\s*(\w+)/.exec(word)?.[1];
  if (name !== undefined) return known.has(name) ? known.get(name) !== null : { word };
  const [, left = '', sign = '', right = ''] = /^(\w+)\s*([<>]=?|[=!]=)\s*(\w+)$/.exec(word) ?? [];
  // As in C, an undefined macro counts as 0.
  const numberOf = (text: string) =>
    /^\d+$/.test(text) ? Number(text) : known.has(text) ? (known.get(text) ?? 0) : null;
  if (sign === '') {
    const value = numberOf(word);
    return value === null ? { word } : value !== 0;
  }
  const [a, b] = [numberOf(left), numberOf(right)];
  if (a === null || b === null) return { word };
  return { '<': a < b, '>': a > b, '<=': a <= b, '>=': a >= b, '==': a === b, '!=': a !== b }[sign]!;
}

function joined(left: Test, sign: '&&' | '||', right: Test): Test {
  const decisive = sign === '||';
  if (left === decisive || right === decisive) return decisive;
  if (typeof left === 'boolean') return right;
  if (typeof right === 'boolean') return left;
  return { left, sign, right };
}

function print(test: Test): string {
  if (typeof test === 'boolean') return test ? '1' : '0';
  if ('word' in test) return test.word;
  if ('not' in test) return `! ( ${print(test.not)} )`;
  return `( ${print(test.left)} ) ${test.sign} ( ${print(test.right)} )`;
}
