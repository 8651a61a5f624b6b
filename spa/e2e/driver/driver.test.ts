import http from 'node:http';
import type { AddressInfo } from 'node:net';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { openChromium } from './chromium.ts';
import type { Browser, Page } from './page.ts';
import { until } from './until.ts';

const HTML = `<!doctype html><title>words</title>
<h1>Words</h1><button onclick="this.textContent = 'pressed'">press</button>
<input aria-label="name" data-testid="name"><p data-testid="hidden" style="display: none">x</p>`;

/** A page that says what its address asks for; Content-Security-Policy as strict as ours. */
function serve(): Promise<http.Server> {
  const server = http.createServer((request, response) => {
    const worker = request.url === '/worker.js';
    response.setHeader('content-type', worker ? 'text/javascript' : 'text/html');
    response.setHeader('content-security-policy', "default-src 'self' 'unsafe-inline'; connect-src *");
    response.end(worker ? `fetch('http://127.0.0.1:9/from-worker').catch(() => {});` : HTML);
  });
  return new Promise((resolve) => server.listen(0, '127.0.0.1', () => resolve(server)));
}

describe('the page driver', () => {
  let browser: Browser;
  let server: http.Server;
  let url: string;
  const opened = async (): Promise<Page> => {
    const page = await browser.newPage({ preload: 'window.first = true' });
    await page.open(url);
    return page;
  };

  beforeAll(async () => {
    browser = await openChromium();
    server = await serve();
    url = `http://127.0.0.1:${(server.address() as AddressInfo).port}/`;
  });
  afterAll(async () => {
    await browser.close();
    server.close();
  });

  it('finds, clicks, types and reads', async () => {
    const page = await opened();
    expect(await page.findByRole('heading').text()).toBe('Words');
    await page.findByRole('button', 'press').click();
    await until('pressed', async () => (await page.text()).includes('pressed'));
    await page.findByTestId('name').type('hubo');
    expect(await page.evaluate<string>('document.querySelector("input").value')).toBe('hubo');
    expect(await page.findByTestId('hidden').visible()).toBe(false);
    expect(await page.findByTestId('absent').count()).toBe(0);
    expect(await page.findByTestId('name').attribute('aria-label')).toBe('name');
    expect(await page.evaluate<boolean>('window.first')).toBe(true);
    await page.viewport({ width: 390, height: 844 });
    expect(await page.evaluate<number>('innerWidth')).toBe(390);
    expect(page.errors).toEqual([]);
    expect(page.foreign).toEqual([]);
    await page.close();
  });

  it.each([
    ['fetch', 'void fetch("http://127.0.0.1:9/away").catch(() => {})'],
    ['a name that is not loopback', 'void fetch("http://example.com/away").catch(() => {})'],
    ['WebSocket', 'void new WebSocket("ws://127.0.0.1:9/away")'],
    ['image', 'void (new Image().src = "http://127.0.0.1:9/away.png")'],
    ['worker', 'void new Worker("/worker.js")'],
  ])('sees a request to another origin: %s', async (_, script) => {
    const page = await opened();
    await page.evaluate(script);
    // what the page's own policy holds back never leaves, but is complained of: either fails a test
    await until('the request or the complaint', () => page.foreign.length + page.errors.length > 0);
    await page.close();
  });

  it('sees console errors and exceptions, but not what a test forgave', async () => {
    const page = await opened();
    await page.evaluate('setTimeout(() => { throw new Error("loud") })');
    await page.evaluate('console.error("logged")');
    await until('both', () => page.errors.length === 2);
    page.forgive(/loud|logged/);
    expect(page.errors).toEqual([]);
    await page.close();
  });

  it('until says what it waited for', async () => {
    await expect(until('the moon', () => null, 10)).rejects.toThrow(/the moon/);
  });
});
