/** Typed values out of JSON that strangers wrote: every failure says where it stands and why. */

const TEXT_MAX = 200; // characters in any one name
const UNFIT = /[\p{Cc}\p{Cs}]/u; // control characters, half a surrogate pair

/** A schema that cannot be used: one line, `where: reason`. */
export class SchemaError extends Error {
  override readonly name = 'SchemaError';
}

export function fail(where: string, reason: string): never {
  throw new SchemaError(`${where}: ${reason}`);
}

/** An object as a Map, so that a key such as `__proto__` is a key like any other; absent reads as empty. */
export function table(value: unknown, where: string): Map<string, unknown> {
  if (value === undefined || value === null) return new Map();
  if (typeof value !== 'object' || Array.isArray(value)) fail(where, 'must be an object');
  return new Map(Object.entries(value));
}

export function items(value: unknown, where: string): readonly unknown[] {
  if (!Array.isArray(value)) fail(where, 'must be a list');
  return value;
}

export function text(value: unknown, where: string): string {
  if (typeof value !== 'string' || value === '' || [...value].length > TEXT_MAX || UNFIT.test(value))
    fail(where, `must be a text of 1 to ${TEXT_MAX} characters without control characters`);
  return value;
}

export function number(value: unknown, where: string): number {
  if (typeof value !== 'number') fail(where, 'must be a number');
  if (!Number.isFinite(value)) fail(where, 'must be a finite number');
  return value;
}

/** A list of texts, none twice. */
export function texts(value: unknown, where: string): readonly string[] {
  const found = items(value, where).map((item, i) => text(item, `${where}[${i}]`));
  const twice = found.find((t, i) => found.indexOf(t) < i);
  if (twice !== undefined) fail(where, `'${twice}' stands there twice`);
  return found;
}
