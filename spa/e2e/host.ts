/** A static file host on loopback, like somebody else's web space: no relay, another origin. */

import { readFile } from 'node:fs/promises';
import http from 'node:http';
import path from 'node:path';
import { gzipSync } from 'node:zlib';

const TYPES: Readonly<Record<string, string>> = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript',
  '.css': 'text/css',
  '.json': 'application/json',
  '.svg': 'image/svg+xml',
};

export class Host {
  readonly #server: http.Server;
  readonly port: number;
  /** Path → text served instead of the file in the folder. */
  readonly instead = new Map<string, string>();
  /** Sent with every answer. */
  headers: Readonly<Record<string, string>> = {};
  /** Like many hosts: compresses files for clients that accept it. */
  packs = false;

  private constructor(server: http.Server, port: number) {
    this.#server = server;
    this.port = port;
  }

  /** Serves `folder` below `prefix`, such as `/~name/robots/`. `port`: 0: a free one. */
  static async open(folder: string, prefix = '/', port = 0): Promise<Host> {
    const server = http.createServer();
    await new Promise<void>((resolve) => server.listen(port, '127.0.0.1', resolve));
    const address = server.address();
    if (address === null || typeof address === 'string') throw new Error('the host has no port');
    const host = new Host(server, address.port);
    server.on('request', async (request, response) => {
      const { pathname } = new URL(request.url ?? '/', host.url);
      const file = pathname.endsWith('/') ? `${pathname}index.html` : pathname;
      const type = TYPES[path.extname(file)] ?? 'application/octet-stream';
      try {
        const below = path.normalize(file.slice(prefix.length));
        if (!file.startsWith(prefix) || below.startsWith('..')) throw new Error('not here');
        const body = host.instead.get(file) ?? (await readFile(path.join(folder, below)));
        const head = { 'content-type': type, 'cache-control': 'no-cache', ...host.headers };
        const isPacked = host.packs && /html|javascript|css|json|svg/.test(type);
        if (isPacked) response.writeHead(200, { ...head, 'content-encoding': 'gzip' }).end(gzipSync(body));
        else response.writeHead(200, head).end(body);
      } catch {
        response.writeHead(404).end('not here');
      }
    });
    return host;
  }

  get url(): string {
    return `http://127.0.0.1:${this.port}`;
  }

  async close(): Promise<void> {
    this.#server.closeAllConnections();
    await new Promise<void>((resolve) => this.#server.close(() => resolve()));
  }
}
