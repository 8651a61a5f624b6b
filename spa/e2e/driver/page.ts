/**
 * The words every browser test is written in. One engine stands behind them at a time
 * (`chromium.ts` now); a word is here only if WebDriver BiDi could serve it too.
 */

/** What may cross into the page and back: JSON, nothing else. */
export type Json = null | boolean | number | string | readonly Json[] | { readonly [key: string]: Json };

export type Role =
  | 'link'
  | 'button'
  | 'heading'
  | 'table'
  | 'row'
  | 'rowheader'
  | 'cell'
  | 'status'
  | 'alert'
  | 'img'
  | 'tab';

/** One element, looked up again at every use: it survives a re-render. */
export interface Element {
  count(): Promise<number>;
  text(): Promise<string>;
  attribute(name: string): Promise<string | null>;
  visible(): Promise<boolean>;
  click(): Promise<void>;
  type(text: string): Promise<void>;
}

export interface Viewport {
  readonly width: number;
  readonly height: number;
}

export interface PageOptions {
  readonly viewport?: Viewport;
  /** JavaScript that runs in every new document before the page's own. */
  readonly preload?: string;
}

export interface Page {
  open(url: string): Promise<void>;
  /** Runs `script` (a function's source or an expression) in the page; its result comes back as JSON. */
  evaluate<T>(script: string | (() => T)): Promise<T>;
  findByRole(role: Role, name?: string | RegExp): Element;
  findByTestId(id: string): Element;
  /** Everything a reader sees. */
  text(): Promise<string>;
  press(key: string): Promise<void>;
  viewport(size: Viewport): Promise<void>;
  /** Writes a PNG; `path` ends in .png. */
  screenshot(path: string): Promise<void>;
  /** Console errors and uncaught exceptions, oldest first. A test that expects one takes it out with `forgive`. */
  readonly errors: readonly string[];
  /** Requests, WebSockets included, to another origin than the one opened. */
  readonly foreign: readonly string[];
  /** Every address asked for, oldest first. */
  readonly requested: readonly string[];
  forgive(pattern: RegExp): void;
  close(): Promise<void>;
}

export interface BrowserOptions {
  /** false: the browser offers no WebGL at all. */
  readonly webgl?: boolean;
}

export interface Browser {
  readonly version: string;
  newPage(options?: PageOptions): Promise<Page>;
  close(): Promise<void>;
}
