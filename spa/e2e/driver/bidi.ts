/** A WebDriver BiDi connection: commands out, answers and events in (https://www.w3.org/TR/webdriver-bidi/#transport). */

import { WebSocket } from 'ws';

const ANSWER_MS = 60_000;

interface Waiting {
  readonly resolve: (result: never) => void;
  readonly reject: (why: Error) => void;
}

interface Message {
  readonly id?: number;
  readonly type: 'success' | 'error' | 'event';
  readonly method?: string;
  readonly params?: unknown;
  readonly result?: unknown;
  readonly error?: string;
  readonly message?: string;
}

export class BidiConnection {
  readonly #socket: WebSocket;
  readonly #waiting = new Map<number, Waiting>();
  readonly #listeners = new Set<(method: string, params: unknown) => void>();
  #lastId = 0;

  private constructor(socket: WebSocket) {
    this.#socket = socket;
    socket.on('message', (data) => this.#take(JSON.parse(String(data)) as Message));
    socket.on('close', () => {
      for (const { reject } of this.#waiting.values()) reject(new Error('the browser has hung up'));
      this.#waiting.clear();
    });
    socket.on('error', () => undefined); // `close` follows
  }

  static async open(url: string): Promise<BidiConnection> {
    const socket = new WebSocket(url);
    await new Promise<void>((resolve, reject) => {
      socket.once('open', resolve);
      socket.once('error', reject);
    });
    return new BidiConnection(socket);
  }

  onEvent(listener: (method: string, params: unknown) => void): void {
    this.#listeners.add(listener);
  }

  send<T = unknown>(method: string, params: object = {}): Promise<T> {
    const id = ++this.#lastId;
    return new Promise<T>((resolve, reject) => {
      const timer = setTimeout(() => {
        this.#waiting.delete(id);
        reject(new Error(`${method}: no answer within ${ANSWER_MS} ms`));
      }, ANSWER_MS);
      this.#waiting.set(id, {
        resolve: (result: T) => {
          clearTimeout(timer);
          resolve(result);
        },
        reject: (why) => {
          clearTimeout(timer);
          reject(new Error(`${method}: ${why.message}`));
        },
      });
      this.#socket.send(JSON.stringify({ id, method, params }));
    });
  }

  close(): void {
    this.#socket.terminate();
  }

  #take(message: Message): void {
    if (message.type === 'event') {
      for (const listener of this.#listeners) listener(message.method ?? '', message.params);
      return;
    }
    const waiting = this.#waiting.get(message.id ?? -1);
    this.#waiting.delete(message.id ?? -1);
    if (message.type === 'error') waiting?.reject(new Error(`${message.error}: ${message.message}`));
    else waiting?.resolve(message.result as never);
  }
}
