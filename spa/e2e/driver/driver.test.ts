import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import http from 'node:http';
import type { AddressInfo } from 'node:net';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { afterAll, beforeAll, describe, expect, it, type TestContext } from 'vitest';
import { openBrowser } from './engines.ts';
import { freePort } from './free_port.ts';
import type { Ability, Browser, Page, Point } from './page.ts';
import { until } from './until.ts';

const HTML = `<!doctype html><title>words</title>
<h1>Words</h1><button onclick="this.textContent = 'pressed'">press</button>
<input aria-label="name" data-testid="name"><p data-testid="hidden" style="display: none">x</p>
<p data-testid="row" style="display: flex"><span>one</span></p>`;

/** A page that does what its address asks for; with a Content-Security-Policy as strict as ours. */
function serve(): Promise<http.Server> {
  const server = http.createServer((request, response) => {
    const worker = request.url?.startsWith('/worker.js');
    response.setHeader('content-type', worker ? 'text/javascript' : 'text/html');
    response.setHeader('content-security-policy', "default-src 'self' 'unsafe-inline'; connect-src *");
    response.end(worker ? `fetch(decodeURIComponent(location.search.slice(1))).catch(() => {});` : HTML);
  });
  return new Promise((resolve) => server.listen(0, '127.0.0.1', () => resolve(server)));
}

describe('the page driver', () => {
  let browser: Browser;
  let server: http.Server;
  let url: string;
  const needs = (context: TestContext, ability: Ability): void => {
    const why = browser.lacks[ability];
    if (why !== undefined) context.skip(why);
  };
  const opened = async (): Promise<Page> => {
    const page = await browser.newPage({ preload: 'window.first = true' });
    await page.open(url);
    return page;
  };

  beforeAll(async () => {
    browser = await openBrowser();
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
    expect(await page.findByTestId('row').text()).toBe('one');
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

  it('presses only what it aimed at, also where that moves away under its finger', async () => {
    const page = await opened();
    // like a page whose layout is pushed down late: between aim and press, another button moves there
    await page.evaluate(`(() => {
      window.heard = [];
      const [button] = document.getElementsByTagName('button');
      const other = button.cloneNode(true);
      other.textContent = 'other';
      for (const one of [button, other]) one.onclick = () => heard.push(one.textContent);
      let moved = false;
      addEventListener('pointermove', () => {
        if (!moved) button.before(other);
        moved = true;
      });
    })()`);
    await page.findByRole('button', 'press').click();
    expect(await page.evaluate<string[]>('window.heard')).toEqual(['press']);
    await page.findByRole('button', 'other').click();
    expect(await page.evaluate<string[]>('window.heard')).toEqual(['press', 'other']);
    await page.close();
  });

  it('loads a page anew', async () => {
    const page = await opened();
    await page.evaluate('window.second = true');
    await page.reload();
    await until('anew', () => page.evaluate<boolean>('window.second === undefined && window.first === true'));
    expect(await page.findByRole('heading').text()).toBe('Words');
    await page.close();
  });

  it.each([
    ['fetch', 'void fetch("http://AWAY/").catch(() => {})'],
    ['a name that is not loopback', 'void fetch("http://example.com/away").catch(() => {})'],
    ['WebSocket', 'void new WebSocket("ws://AWAY/")'],
    ['image', 'void (new Image().src = "http://AWAY/away.png")'],
    ['worker', 'void new Worker("/worker.js?" + encodeURIComponent("http://AWAY/"))'],
  ])('sees a request to another origin: %s', async (_, script) => {
    const page = await opened();
    const away = `127.0.0.1:${await freePort()}`; // where nobody answers
    await page.evaluate(script.replace('AWAY', away));
    // a request blocked by the page's own policy is never sent, but is logged: both fail a test
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

  /** The input events that the page received, abbreviated, with repetitions merged. */
  const listen = (page: Page) =>
    page.evaluate(`(() => {
      window.heard = [];
      const hear = (word) => { if (heard.at(-1) !== word) heard.push(word); };
      for (const type of ['pointerdown', 'pointermove', 'pointerup']) {
        addEventListener(type, (e) => {
          if (type !== 'pointermove' || e.buttons !== 0) hear([type.slice(7), e.pointerType, e.buttons].join(' '));
        });
      }
      addEventListener('dblclick', () => hear('dblclick'));
      addEventListener('wheel', (e) => hear('wheel ' + Math.sign(e.deltaY)));
      addEventListener('keydown', (e) => hear(['key', e.shiftKey ? 'Shift' : '', e.key].join(' ')));
      addEventListener('contextmenu', (e) => e.preventDefault());
      document.body.style.cssText = 'height: 100vh; touch-action: none';
    })()`);
  const said = (page: Page) => page.evaluate<string[]>('window.heard');
  const middle: Point = { x: 300, y: 300 };
  const beside: Point = { x: 380, y: 320 };

  it('drags, clicks twice and presses keys', async () => {
    const page = await opened();
    await listen(page);
    await page.drag(middle, beside);
    expect(await said(page)).toEqual(['down mouse 1', 'move mouse 1', 'up mouse 0']);
    await page.doubleClick({ x: 300, y: 200 }); // if the drag began here, this would be the second and the third click
    await until('two clicks', async () => (await said(page)).at(-1) === 'dblclick');
    await page.press('Escape');
    await page.press('Shift+ArrowLeft');
    await page.press('f');
    expect((await said(page)).slice(-4)).toEqual([
      'key  Escape',
      'key Shift Shift',
      'key Shift ArrowLeft',
      'key  f',
    ]);
    await page.close();
  });

  it('drags with the right button and turns the wheel', async (context) => {
    needs(context, 'buttons');
    needs(context, 'wheel');
    const page = await opened();
    await listen(page);
    await page.drag(beside, middle, 'right');
    expect(await said(page)).toEqual(['down mouse 2', 'move mouse 2', 'up mouse 0']);
    await page.wheel(middle, 120);
    await until('the wheel', async () => (await said(page)).at(-1) === 'wheel 1');
    await page.close();
  });

  it('drags an element onto another', async (context) => {
    needs(context, 'drops');
    const page = await opened();
    await page.evaluate(`(() => {
      window.heard = [];
      const dragged = document.body.appendChild(document.createElement('div'));
      dragged.draggable = true;
      dragged.style.cssText = 'position: fixed; left: 200px; top: 200px; width: 200px; height: 110px';
      for (const type of ['dragstart', 'drop', 'dragend']) addEventListener(type, () => window.heard.push(type));
      addEventListener('dragstart', (e) => e.dataTransfer.setData('text/plain', 'x'));
      addEventListener('dragover', (e) => e.preventDefault());
    })()`);
    await page.drag(middle, { x: 300, y: 400 });
    await until('the end', async () => (await said(page)).length === 3);
    expect(await said(page)).toEqual(['dragstart', 'drop', 'dragend']);
    await page.close();
  });

  it('drags files and folders onto the page', async (context) => {
    needs(context, 'files');
    const folder = mkdtempSync(path.join(tmpdir(), 'posecast-drag-'));
    writeFileSync(path.join(folder, 'inside.txt'), 'x');
    const page = await opened();
    await page.evaluate(`(() => {
      window.heard = [];
      addEventListener('dragover', (e) => e.preventDefault());
      addEventListener('drop', (e) => {
        e.preventDefault();
        for (const item of e.dataTransfer.items) window.heard.push(item.webkitGetAsEntry().isDirectory ? 'folder' : 'file');
      });
    })()`);
    await page.dropFiles(middle, [folder, path.join(folder, 'inside.txt')]);
    await until('the drop', async () => (await said(page)).length > 0);
    expect(await said(page)).toEqual(['folder', 'file']);
    await page.close();
    rmSync(folder, { recursive: true });
  });

  it('touches with one finger and with two', async (context) => {
    needs(context, 'touch');
    const page = await browser.newPage({ touch: true });
    await page.open(url);
    await listen(page);
    await page.touch({ from: middle, to: beside });
    expect(await said(page)).toEqual(['down touch 1', 'move touch 1', 'up touch 0']);
    await page.touch({ from: middle, to: beside }, { from: { x: 200, y: 200 }, to: { x: 100, y: 100 } });
    expect((await said(page)).slice(3)).toEqual(['down touch 1', 'move touch 1', 'up touch 0']);
    await page.close();
  });

  it.for(['dark', 'light'] as const)('has a system set to little motion and %s', async (scheme, context) => {
    needs(context, 'media');
    const page = await browser.newPage({ media: { motion: 'reduce', scheme } });
    await page.open(url);
    for (const query of ['(prefers-reduced-motion: reduce)', `(prefers-color-scheme: ${scheme})`])
      expect(await page.evaluate<boolean>(`matchMedia('${query}').matches`), query).toBe(true);
    await page.close();
    const another = await opened();
    expect(await another.evaluate<boolean>(`matchMedia('(prefers-reduced-motion: reduce)').matches`)).toBe(
      false,
    );
    await another.close();
  });

  it('until says what it waited for', async () => {
    await expect(until('the moon', () => null, 10)).rejects.toThrow(/the moon/);
  });
});
