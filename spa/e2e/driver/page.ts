/**
 * The words every browser test is written in. One of three engines stands behind them (`engines.ts`); what an engine
 * can't do it names in `lacks`, and a test that needs it is skipped with that reason.
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

/** CSS pixels from the viewport's upper left corner. */
export interface Point {
  readonly x: number;
  readonly y: number;
}

export type Button = 'left' | 'middle' | 'right';

/** One finger that goes down, moves in a straight line and is lifted. */
export interface Finger {
  readonly from: Point;
  readonly to: Point;
}

export interface PageOptions {
  readonly viewport?: Viewport;
  /** JavaScript that runs in every new document before the page's own. */
  readonly preload?: string;
  /** A device with a touch screen; needs `touch`. */
  readonly touch?: boolean;
  /** What the reader has asked of the system; needs `media`. */
  readonly media?: {
    readonly motion?: 'reduce';
    readonly scheme?: 'dark' | 'light';
    /** The system's own few colours instead of the page's; needs `colors`. */
    readonly colors?: 'forced';
  };
}

export interface Page {
  open(url: string): Promise<void>;
  /** Loads the page anew. */
  reload(): Promise<void>;
  /** Waits until a document that came by itself is there: a driver may never answer for the one before it. */
  loaded(): Promise<void>;
  /** Runs `script` (a function's source or an expression) in the page; its result comes back as JSON. */
  evaluate<T>(script: string | (() => T)): Promise<T>;
  findByRole(role: Role, name?: string | RegExp): Element;
  findByTestId(id: string): Element;
  /** Everything a reader sees. */
  text(): Promise<string>;
  /** A key by its name, with modifiers before it: `Escape`, `a`, `Shift+ArrowLeft`. */
  press(key: string): Promise<void>;
  /** Moves the pressed mouse in a straight line; another button than the left needs `buttons`, what is to be dropped `drops`. */
  drag(from: Point, to: Point, button?: Button): Promise<void>;
  click(at: Point): Promise<void>;
  doubleClick(at: Point): Promise<void>;
  /** Turns the wheel over a point; positive scrolls down. Needs `wheel`. */
  wheel(at: Point, pixels: number): Promise<void>;
  /** All fingers together, in a few steps; needs `touch`. */
  touch(...fingers: Finger[]): Promise<void>;
  /** Two quick taps of one finger; needs `touch`. */
  doubleTap(at: Point): Promise<void>;
  /** Drags files and folders (absolute paths) from the desktop and lets them go at a point; needs `files`. */
  dropFiles(at: Point, paths: readonly string[]): Promise<void>;
  /** Lets the page have one part in so many of the processor; 1 undoes it. Needs `slow`. */
  slow(times: number): Promise<void>;
  /** Stops the programs that pages run in, as a device does that sleeps, until what it returns is called. Needs `stop`. */
  stop(): Promise<() => void>;
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
  /** From now on this host is none of the `foreign` ones. */
  allow(host: string): void;
  close(): Promise<void>;
}

export interface BrowserOptions {
  /** false: the browser offers no WebGL at all. */
  readonly webgl?: boolean;
  /** true: a certificate of an authority nobody knows is taken (Chromium only). */
  readonly strangersCertificate?: boolean;
}

export type Ability =
  | 'touch'
  | 'media'
  | 'colors'
  | 'slow'
  | 'stop'
  | 'buttons'
  | 'wheel'
  | 'drops'
  | 'files'
  | 'cache';

export interface Browser {
  readonly engine: EngineName;
  readonly version: string;
  /** Why a test that needs this can't be played here. `cache`: answers over HTTP are kept from visit to visit. */
  readonly lacks: Readonly<Partial<Record<Ability, string>>>;
  newPage(options?: PageOptions): Promise<Page>;
  close(): Promise<void>;
}

export type EngineName = 'chromium' | 'firefox' | 'webkitgtk';
