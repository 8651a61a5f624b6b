/** A reverse proxy on loopback that may answer instead of the relay: one that asks people to sign in, or is just restarting. */

import http from 'node:http';
import net from 'node:net';
import type { Duplex } from 'node:stream';

/** An answer of the proxy itself. */
export interface OwnAnswer {
  readonly status: number;
  readonly headers?: Readonly<Record<string, string>>;
  readonly body?: string;
}

export class Gate {
  /** Answers instead of the relay, WebSockets included; null lets the request through. */
  answer: (request: http.IncomingMessage) => OwnAnswer | 'reset' | null = () => null;
  /** Added to every document of the relay. */
  documentHeaders: Readonly<Record<string, string>> = {};
  readonly port: number;
  readonly #server: http.Server;
  readonly #targetPort: number;
  readonly #sockets = new Set<Duplex>();

  private constructor(server: http.Server, port: number, targetPort: number) {
    this.#server = server;
    this.port = port;
    this.#targetPort = targetPort;
  }

  /** Listens on a free port of 127.0.0.1 and passes on to `targetPort`. */
  static async open(targetPort: number): Promise<Gate> {
    const server = http.createServer();
    await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
    const address = server.address();
    if (address === null || typeof address === 'string') throw new Error('the gate has no port');
    const gate = new Gate(server, address.port, targetPort);
    server.on('request', (request, response) => gate.#pass(request, response));
    server.on('upgrade', (request, socket, head) => gate.#upgrade(request, socket, head));
    return gate;
  }

  get url(): string {
    return `http://127.0.0.1:${this.port}`;
  }

  /** Ends every WebSocket. */
  cut(): void {
    for (const socket of this.#sockets) socket.destroy();
  }

  async close(): Promise<void> {
    this.cut();
    this.#server.closeAllConnections();
    await new Promise<void>((resolve) => this.#server.close(() => resolve()));
  }

  #pass(request: http.IncomingMessage, response: http.ServerResponse): void {
    const own = this.answer(request);
    if (own === 'reset') {
      request.socket.resetAndDestroy();
      return;
    }
    if (own !== null) {
      response.writeHead(own.status, { 'cache-control': 'no-store', ...own.headers }).end(own.body ?? '');
      return;
    }
    const { method = 'GET', url = '/', headers } = request;
    const onward = http.request(
      { host: '127.0.0.1', port: this.#targetPort, method, path: url, headers, agent: false },
      (answer) => {
        const isDocument = (answer.headers['content-type'] ?? '').startsWith('text/html');
        response.writeHead(answer.statusCode ?? 502, {
          ...answer.headers,
          ...(isDocument ? this.documentHeaders : {}),
        });
        answer.pipe(response);
      },
    );
    onward.on('error', () => response.destroy());
    response.on('close', () => onward.destroy());
    request.pipe(onward);
  }

  #upgrade(request: http.IncomingMessage, socket: Duplex, head: Buffer): void {
    const own = this.answer(request);
    socket.on('error', () => undefined);
    if (own === 'reset') {
      socket.destroy();
      return;
    }
    if (own !== null) {
      socket.end(`HTTP/1.1 ${own.status} no\r\nconnection: close\r\ncontent-length: 0\r\n\r\n`);
      return;
    }
    const relay = net.connect({ port: this.#targetPort, host: '127.0.0.1' });
    relay.on('error', () => socket.destroy());
    const lines = [`GET ${request.url} HTTP/1.1`];
    for (let i = 0; i < request.rawHeaders.length; i += 2)
      lines.push(`${request.rawHeaders[i]}: ${request.rawHeaders[i + 1]}`);
    relay.write(`${lines.join('\r\n')}\r\n\r\n`);
    relay.write(head);
    relay.pipe(socket).pipe(relay);
    for (const end of [socket, relay]) {
      this.#sockets.add(end);
      end.on('close', () => {
        this.#sockets.delete(end);
        socket.destroy();
        relay.destroy();
      });
    }
  }
}
