/** Reads typed values from untrusted JSON. An error is one short line that says where and why. */

import { visible } from './visible.ts';

const TEXT_MAX = 200; // characters in any one name
const DEPTH_MAX = 64; // levels of a document, itself the first
const SHOWN_MAX = 160; // characters of a place or a reason in a line
const SURROGATE = /\p{Cs}/u; // half a pair; a whole one is a character
const UNFIT = /[\p{Cc}\p{Cs}]/u;

/** A schema that cannot be used: one line, `where: reason`. */
export class SchemaError extends Error {
  override readonly name = 'SchemaError';
}

export function fail(where: string, reason: string): never {
  throw new SchemaError(`${line(where)}: ${line(reason)}`);
}

/** A stranger's text in a line of ours: 160 characters; what is unseen or turns direction is escaped. */
function line(text: string): string {
  return visible(text.length > SHOWN_MAX ? `${text.slice(0, SHOWN_MAX - 60)}…${text.slice(-59)}` : text);
}

/**
 * JSON as SPEC §1 has it: every text is Unicode, every number finite, and there are at most 64 levels. SyntaxError
 * on the rest. It takes time in proportion to the document, and no recursion.
 */
export function parseJson(text: string): unknown {
  if (SURROGATE.test(text)) throw new SyntaxError('not Unicode');
  const document: unknown = JSON.parse(text);
  let level = [document];
  for (let depth = 0; level.length > 0; depth++) {
    if (depth === DEPTH_MAX) throw new SyntaxError(`more than ${DEPTH_MAX} levels`);
    level = checked(level);
  }
  return document;
}

/** What stands inside the values of a level, which are found sound themselves. */
function checked(level: readonly unknown[]): unknown[] {
  const inside: unknown[] = [];
  for (const value of level) {
    if (typeof value === 'string') {
      if (SURROGATE.test(value)) throw new SyntaxError('a text that is not Unicode');
    } else if (typeof value === 'number') {
      if (!Number.isFinite(value)) throw new SyntaxError('a number that is not finite');
    } else if (Array.isArray(value)) {
      for (const item of value) inside.push(item);
    } else if (isObject(value)) {
      for (const [name, item] of Object.entries(value)) inside.push(name, item);
    }
  }
  return inside;
}

export function isObject(value: unknown): value is object {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

/** An object as a Map, so that a key such as `__proto__` is a key like any other; absent reads as empty. */
export function table(value: unknown, where: string): Map<string, unknown> {
  if (value === undefined || value === null) return new Map();
  if (!isObject(value)) fail(where, 'must be an object');
  return new Map(Object.entries(value));
}

/** A member of an object, or what it means that there is none. */
export function member(doc: ReadonlyMap<string, unknown>, name: string, silent: unknown): unknown {
  return doc.has(name) ? doc.get(name) : silent;
}

/** An object whose names are texts, each value read by `read`; absent reads as empty. */
export function entries<T>(
  value: unknown,
  where: string,
  read: (v: unknown, at: string, name: string) => T,
): Map<string, T> {
  const found = new Map<string, T>();
  for (const [name, v] of table(value, where))
    found.set(text(name, `${where} key`), read(v, `${where}.${name}`, name));
  return found;
}

export function items(value: unknown, where: string): readonly unknown[] {
  if (!Array.isArray(value)) fail(where, 'must be a list');
  return value;
}

export function text(value: unknown, where: string): string {
  if (typeof value !== 'string' || !isShort(value) || UNFIT.test(value))
    fail(where, `must be a text of 1 to ${TEXT_MAX} characters without control characters`);
  return value;
}

/** A character takes one or two units of a string: only what may be short enough is counted. */
function isShort(value: string): boolean {
  return value.length > 0 && value.length <= 2 * TEXT_MAX && [...value].length <= TEXT_MAX;
}

export function number(value: unknown, where: string): number {
  if (typeof value !== 'number') fail(where, 'must be a number');
  if (!Number.isFinite(value)) fail(where, 'must be a finite number');
  return value;
}

/** A list of texts, `most` of them, none twice. */
export function texts(value: unknown, where: string, most: number): readonly string[] {
  const listed = items(value, where);
  if (listed.length > most) fail(where, `more than ${most} names`);
  const found = new Set<string>();
  listed.forEach((item, i) => {
    const name = text(item, `${where}[${i}]`);
    if (found.has(name)) fail(where, `'${name}' appears twice`);
    found.add(name);
  });
  return [...found];
}
