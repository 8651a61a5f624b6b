import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import type { Page, Viewport } from './driver/page.ts';
import { until } from './driver/until.ts';
import { finest, liveness } from './robot_page.ts';
import { choose, DEMO, demoAt, shown } from './sign_words.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const MOST_BYTES = 60_000;
const LAPTOP = { width: 1280, height: 800 };
const PHONE = { width: 390, height: 844 };
const JAMMED_S = 42;

interface Part {
  readonly png: string;
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

/** Parts of pictures, one below the other and as wide as the widest, as docs/img/NAME.webp. */
async function write(page: Page, name: string, scale: number, ...parts: Part[]): Promise<void> {
  const webp = await page.evaluate<string>(`(async () => {
    const parts = ${JSON.stringify(parts)};
    const canvas = document.createElement('canvas');
    const width = Math.max(...parts.map((part) => part.width));
    canvas.width = width * ${scale};
    canvas.height = parts.reduce((sum, part) => sum + part.height, 0) * ${scale};
    const context = canvas.getContext('2d');
    context.imageSmoothingQuality = 'high';
    let y = 0;
    for (const part of parts) {
      const bytes = Uint8Array.from(atob(part.png), (c) => c.charCodeAt(0));
      const bitmap = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
      const { x, y: top, height } = part;
      context.drawImage(bitmap, x, top, width, height, 0, y, width * ${scale}, height * ${scale});
      y += height * ${scale};
    }
    return canvas.toDataURL('image/webp', 0.82).split(',')[1];
  })()`);
  const bytes = Buffer.from(webp, 'base64');
  expect(bytes.length, `${name} is small`).toBeLessThan(MOST_BYTES);
  writeFileSync(path.join(REPO, `docs/img/${name}.webp`), bytes);
  console.log(`${name}: ${(bytes.length / 1000).toFixed(0)} kB`);
}

async function photo(page: Page): Promise<string> {
  // the machine that makes the pictures draws in software; a reader's does not
  await page.evaluate(
    `for (const note of document.querySelectorAll('[data-testid=stage-note]')) note.style.display = 'none'`,
  );
  const file = path.join(stage.stack.folder(), 'photo.png');
  await page.screenshot(file);
  return readFileSync(file).toString('base64');
}

async function whole(page: Page, { width, height }: Viewport): Promise<Part> {
  return { png: await photo(page), x: 0, y: 0, width, height };
}

/** What the page shows of an element, with a little room around it. */
async function around(page: Page, selector: string, room: number): Promise<Part> {
  const box = await page.evaluate<{ x: number; y: number; width: number; height: number }>(
    `(({ x, y, width, height }) => ({ x, y, width, height }))(document.querySelector(${JSON.stringify(selector)}).getBoundingClientRect())`,
  );
  return {
    png: await photo(page),
    x: Math.round(box.x - room),
    y: Math.round(box.y - room),
    width: Math.round(box.width + 2 * room),
    height: Math.round(box.height + 2 * room),
  };
}

const is = (page: Page, word: string) => until(word, async () => (await liveness(page)) === word, 60_000);

describe.runIf(process.env.POSECAST_WRITE_GUIDE === '1')("the guide's pictures", () => {
  it('the four words, and a picture that is old', async () => {
    const relay = await stage.stack.relay();
    const moving = { ...demoAt(1), wave: { pos: { RSP: [0.3, 0.4], LSP: [0.3, 0.4], REB: [0.4, 0.3] } } };
    const { source, edge } = stage.stack.fedEdge(relay, moving, DEMO);
    const page = await stage.newPage({ viewport: LAPTOP });
    await page.open(`${relay.url}/#/r/demo`);
    await shown(page);
    await choose(page, { theme: 'dark' });
    await until('its finest shells', () => finest(page), 60_000);
    await is(page, 'LIVE');
    const chip = '[data-testid="liveness"]';
    await until('a rate', async () => /Hz/.test((await page.findByTestId('liveness').text()) ?? ''));
    const words = [await around(page, chip, 8)];
    source.write(JSON.stringify(demoAt(1)));
    await is(page, 'HOLDING');
    words.push(await around(page, chip, 8));
    source.signal('SIGSTOP');
    await is(page, 'STALE');
    words.push(await around(page, chip, 8));
    await write(page, 'guide-stale', 0.75, await whole(page, LAPTOP));
    source.signal('SIGCONT');
    await is(page, 'HOLDING');
    await edge.kill();
    await is(page, 'OFFLINE');
    words.push(await around(page, chip, 8));
    await write(page, 'guide-words', 1, ...words);
  }, 240_000);

  it('a fault on a phone, and its plot', async () => {
    const relay = await stage.stack.relay();
    const jammed = { ...demoAt(JAMMED_S), wave: { ref: { RKN: [0.2, 0.3] }, cur: { RKN: [4, 0.3] } } };
    stage.stack.fedEdge(relay, jammed, DEMO);
    const page = await stage.newPage({ viewport: PHONE });
    await page.open(`${relay.url}/#/r/demo`);
    await shown(page);
    await choose(page, { theme: 'light' });
    await until('its finest shells', () => finest(page), 60_000);
    await page.findByRole('button', /^RKN jam/).click();
    const card = page.findByTestId('joint-card');
    await until('its card', async () => (await card.count()) === 1);
    const points = () =>
      page.evaluate<number>('document.querySelector(".trace-pos").getAttribute("d").split(/[ML]/).length');
    await until('a strip', async () => (await points()) > 150, 60_000);
    await write(page, 'guide-fault', 1, await whole(page, PHONE));

    await page.viewport(LAPTOP);
    for (const field of ['pos', 'ref', 'cur']) await page.findByTestId(`plot-${field}`).click();
    await page.findByRole('tab', /^Plots/).click();
    await until('three traces', () =>
      page.evaluate<boolean>('document.querySelectorAll("[data-testid=trace]").length === 3'),
    );
    const seq = () => page.evaluate<number>('window.posecast.twin.seq');
    const before = await seq();
    await until('ten seconds of them', async () => (await seq()) > before + 300, 60_000);
    await write(page, 'guide-plot', 0.75, await whole(page, LAPTOP));
  }, 240_000);
});
