/** The errors that a page has logged, kept until a test forgives them. */
export class Complaints {
  readonly errors: string[] = [];
  readonly #forgiven: RegExp[];

  /** `always`: the browser's own messages about a connection that a test has cut; the page can't silence them. */
  constructor(...always: RegExp[]) {
    this.#forgiven = always;
  }

  add(text: string): void {
    if (!this.#forgiven.some((pattern) => pattern.test(text))) this.errors.push(text);
  }

  forgive(pattern: RegExp): void {
    this.#forgiven.push(pattern);
    const kept = this.errors.filter((text) => !pattern.test(text));
    this.errors.splice(0, this.errors.length, ...kept);
  }
}

/** Returns those addresses that are neither on the opened host nor on one that a test has allowed. */
export function foreignTo(
  host: string | null,
  allowed: ReadonlySet<string>,
  addresses: readonly string[],
): string[] {
  return addresses.filter((address) => {
    const url = new URL(address);
    const inside = url.protocol === 'data:' || url.protocol === 'blob:';
    return !inside && url.host !== host && !allowed.has(url.host);
  });
}
