/**
 * The interface that every browser test is written in, implemented for three engines (`engines.ts`). Features that an engine
 * lacks are listed in `lacks`; a test that needs one is skipped with that reason.
 */

/** Values that can be passed into the page and back: only JSON. */
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
  /** Preferences that the reader has set in the system; needs `media`. */
  readonly media?: {
    readonly motion?: 'reduce';
    readonly scheme?: 'dark' | 'light';
    /** The system's forced colours instead of the page's; needs `colors`. */
    readonly colors?: 'forced';
  };
}

export interface Page {
  open(url: string): Promise<void>;
  /** Reloads the page. */
  reload(): Promise<void>;
  /** Waits until a document that loads on its own is there: a driver may never answer for the previous one. */
  loaded(): Promise<void>;
  /** Runs `script` (a function's source or an expression) in the page; returns its result, transferred as JSON. */
  evaluate<T>(script: string | (() => T)): Promise<T>;
  findByRole(role: Role, name?: string | RegExp): Element;
  findByTestId(id: string): Element;
  /** All visible text. */
  text(): Promise<string>;
  /** A key by its name, with modifiers before it: `Escape`, `a`, `Shift+ArrowLeft`. */
  press(key: string): Promise<void>;
  /** Moves the pressed mouse in a straight line; buttons other than the left need `buttons`, dropping needs `drops`. */
  drag(from: Point, to: Point, button?: Button): Promise<void>;
  click(at: Point): Promise<void>;
  doubleClick(at: Point): Promise<void>;
  /** Turns the wheel over a point; positive scrolls down. Needs `wheel`. */
  wheel(at: Point, pixels: number): Promise<void>;
  /** All fingers together, in a few steps; needs `touch`. */
  touch(...fingers: Finger[]): Promise<void>;
  /** Two quick taps of one finger; needs `touch`. */
  doubleTap(at: Point): Promise<void>;
  /** Drags files and folders (absolute paths) from the desktop and drops them at a point; needs `files`. */
  dropFiles(at: Point, paths: readonly string[]): Promise<void>;
  /** Slows the page's processor down by this factor; 1 removes the limit. Needs `slow`. */
  slow(times: number): Promise<void>;
  /** Stops the processes that run pages, like a sleeping device, until the returned function is called. Needs `stop`. */
  stop(): Promise<() => void>;
  viewport(size: Viewport): Promise<void>;
  /** Writes a PNG; `path` ends in .png. */
  screenshot(path: string): Promise<void>;
  /** Console errors and uncaught exceptions, oldest first. A test that expects one removes it with `forgive`. */
  readonly errors: readonly string[];
  /** Requests, WebSockets included, to another origin than the one opened. */
  readonly foreign: readonly string[];
  /** Every requested address, oldest first. */
  readonly requested: readonly string[];
  forgive(pattern: RegExp): void;
  /** From now on this host does not count as `foreign`. */
  allow(host: string): void;
  close(): Promise<void>;
}

export interface BrowserOptions {
  /** false: the browser offers no WebGL at all. */
  readonly webgl?: boolean;
  /** true: certificates from unknown authorities are accepted (Chromium only). */
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
  /** Why a test that needs this can't run here. `cache`: HTTP answers are kept between visits. */
  readonly lacks: Readonly<Partial<Record<Ability, string>>>;
  newPage(options?: PageOptions): Promise<Page>;
  close(): Promise<void>;
}

export type EngineName = 'chromium' | 'firefox' | 'webkitgtk';
