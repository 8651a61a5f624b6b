/** The interface of `page.ts` on top of a WebDriver remote end, for both protocols. */

import { writeFileSync } from 'node:fs';
import * as actions from './actions.ts';
import { type Complaints, foreignTo } from './complaints.ts';
import { type Act, inPage, LANDED, type Landed, type Query } from './in_page.ts';
import type { Button, Element, Finger, Json, Page, Point, Role, Viewport } from './page.ts';
import { until } from './until.ts';
import type { WatchingProxy } from './watching_proxy.ts';

/** A press that no page has reported within this time is lost. */
const PRESS_MS = 1000;

/** One page at the remote end of a driver connection. */
export interface RemoteEnd {
  navigate(url: string): Promise<void>;
  reload(): Promise<void>;
  loaded(): Promise<void>;
  /** Evaluates an expression, and waits for it if it is a promise; the result is JSON text. */
  evaluate(expression: string): Promise<string | null>;
  perform(actions: actions.Actions): Promise<void>;
  resize(size: Viewport): Promise<void>;
  /** A PNG. */
  capture(): Promise<Buffer>;
  close(): Promise<void>;
}

export class RemotePage implements Page {
  readonly #end: RemoteEnd;
  readonly #proxy: WatchingProxy;
  readonly #complaints: Complaints;
  readonly #allowed = new Set<string>();
  #host: string | null = null;
  #closed = false;

  constructor(end: RemoteEnd, proxy: WatchingProxy, complaints: Complaints) {
    this.#end = end;
    this.#proxy = proxy;
    this.#complaints = complaints;
  }

  get errors(): readonly string[] {
    return this.#complaints.errors;
  }

  get requested(): readonly string[] {
    return this.#proxy.requested;
  }

  get foreign(): readonly string[] {
    return foreignTo(this.#host, this.#allowed, this.#proxy.requested);
  }

  async open(url: string): Promise<void> {
    this.#host = new URL(url).host;
    await this.#end.navigate(url);
  }

  reload(): Promise<void> {
    return this.#end.reload();
  }

  loaded(): Promise<void> {
    return this.#end.loaded();
  }

  async evaluate<T>(script: string | (() => T)): Promise<T> {
    const expression = typeof script === 'string' ? script : `(${script})()`;
    // JSON is made in the page, because the result may be something that no protocol can carry
    const text = await this.#end.evaluate(
      `Promise.resolve(${expression.replace(/;\s*$/, '')}).then((value) => JSON.stringify(value) ?? null)`,
    );
    return (text === null ? undefined : JSON.parse(text)) as T;
  }

  findByRole(role: Role, name?: string | RegExp): Element {
    if (name instanceof RegExp) {
      return this.#element({ role, pattern: { source: name.source, flags: name.flags } });
    }
    return this.#element({ role, ...(name === undefined ? {} : { name }) });
  }

  findByTestId(id: string): Element {
    return this.#element({ testId: id });
  }

  text(): Promise<string> {
    return this.evaluate<string>('document.body.innerText');
  }

  press(key: string): Promise<void> {
    return this.#end.perform(actions.keys(key));
  }

  drag(from: Point, to: Point, button: Button = 'left'): Promise<void> {
    return this.#end.perform(actions.drag({ from, to }, button));
  }

  click(at: Point): Promise<void> {
    return this.#end.perform(actions.click(at));
  }

  doubleClick(at: Point): Promise<void> {
    return this.#end.perform(actions.click(at, 2));
  }

  wheel(at: Point, pixels: number): Promise<void> {
    return this.#end.perform(actions.wheel(at, pixels));
  }

  touch(...fingers: Finger[]): Promise<void> {
    return this.#end.perform(actions.touch(fingers));
  }

  doubleTap(at: Point): Promise<void> {
    return this.#end.perform(actions.doubleTap(at));
  }

  dropFiles(): Promise<void> {
    throw new Error('this driver drags no files');
  }

  slow(): Promise<void> {
    throw new Error('this driver has no word for a slow processor');
  }

  stop(): Promise<() => void> {
    throw new Error('this driver does not know what a page runs in');
  }

  viewport(size: Viewport): Promise<void> {
    return this.#end.resize(size);
  }

  async screenshot(path: string): Promise<void> {
    writeFileSync(path, await this.#end.capture());
  }

  forgive(pattern: RegExp): void {
    this.#complaints.forgive(pattern);
  }

  allow(host: string): void {
    this.#allowed.add(host);
  }

  async close(): Promise<void> {
    if (this.#closed) return;
    this.#closed = true;
    await this.#end.close();
    await this.#proxy.close();
  }

  /** Whether the press hit its target. If it led to another document, the old one is not asked. */
  async #hit(): Promise<boolean> {
    const lateMs = performance.now() + PRESS_MS;
    for (;;) {
      const landed = await this.evaluate<Landed>(LANDED).catch(() => null);
      if (landed !== 'nothing yet') return landed !== 'missed';
      if (performance.now() > lateMs) return false;
    }
  }

  #element(query: Query): Element {
    const once = <T extends Json>(act: Act) => this.evaluate<T>(inPage(query, act));
    /** Retried until the element exists and is ready. */
    const patiently = async <T extends Json>(act: Act): Promise<T> => {
      const { answer } = await until(`${act.do} of ${JSON.stringify(query)}`, async () => {
        const answer = await once<T>(act);
        if (typeof answer === 'object' && answer !== null && 'not' in answer) {
          throw new Error(`it is not ${answer.not}`);
        }
        return { answer };
      });
      return answer;
    };
    return {
      count: () => once({ do: 'count' }),
      visible: () => once({ do: 'visible' }),
      text: () => patiently({ do: 'text' }),
      attribute: (name) => patiently({ do: 'attribute', name }),
      type: async (text) => void (await patiently({ do: 'fill', text })),
      click: () =>
        until(`a click on ${JSON.stringify(query)}`, async () => {
          let before: Point | null = null;
          const at = await until(`${JSON.stringify(query)} stands still`, async () => {
            const last = before;
            before = await patiently<Point & Json>({ do: 'aim' });
            return last !== null && last.x === before.x && last.y === before.y ? before : null;
          });
          await this.#end.perform(actions.click(at));
          return this.#hit();
        }).then(() => undefined),
    };
  }
}
