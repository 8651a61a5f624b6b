import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import type { Page, Viewport } from './driver/page.ts';
import { until } from './driver/until.ts';
import { finest, liveness, resting } from './robot_page.ts';
import { choose, DEMO, demoAt, shown } from './sign_words.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const MOST_BYTES_EACH = 60_000;
/** Between two pictures side by side. */
const GAP = 16;
const LAPTOP = { width: 1280, height: 800 };
const PHONE = { width: 390, height: 844 };
const JAMMED_S = 42;
const DEMO_HEIGHT = 640;

interface Part {
  readonly png: string;
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
  /** Pixels of the picture for one of the page's. */
  readonly scale: number;
}

/** Parts of pictures, one below the other or with a gap side by side, as docs/img/NAME.webp. */
async function write(page: Page, name: string, way: 'down' | 'across', ...parts: Part[]): Promise<void> {
  const webp = await page.evaluate<string>(`(async () => {
    const parts = ${JSON.stringify(parts)};
    const across = ${way === 'across'};
    const sizes = parts.map(({ width, height, scale }) => [Math.round(width * scale), Math.round(height * scale)]);
    const most = (at) => Math.max(...sizes.map((size) => size[at]));
    const sum = (at) => sizes.reduce((all, size) => all + size[at], 0);
    const canvas = document.createElement('canvas');
    canvas.width = across ? sum(0) + (parts.length - 1) * ${GAP} : most(0);
    canvas.height = across ? most(1) : sum(1);
    const context = canvas.getContext('2d');
    context.imageSmoothingQuality = 'high';
    let along = 0;
    for (const [i, part] of parts.entries()) {
      const bytes = Uint8Array.from(atob(part.png), (c) => c.charCodeAt(0));
      const bitmap = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
      const [width, height] = sizes[i];
      const to = across ? [along, 0] : [0, along];
      context.drawImage(bitmap, part.x, part.y, part.width, part.height, ...to, width, height);
      along += across ? width + ${GAP} : height;
    }
    return canvas.toDataURL('image/webp', 0.82).split(',')[1];
  })()`);
  const bytes = Buffer.from(webp, 'base64');
  expect(bytes.length, `${name} is small`).toBeLessThan(
    MOST_BYTES_EACH * (way === 'across' ? parts.length : 1),
  );
  writeFileSync(path.join(REPO, `docs/img/${name}.webp`), bytes);
  console.log(`${name}: ${(bytes.length / 1000).toFixed(0)} kB`);
}

/** The machine that makes the pictures draws in software and is told so; a reader's does not. */
async function asOnOthers(page: Page): Promise<void> {
  await page.evaluate(`(() => {
    const sheet = new CSSStyleSheet();
    sheet.replaceSync('[data-testid=view-note], [data-testid=finer] { display: none !important }');
    document.adoptedStyleSheets = [sheet];
  })()`);
}

async function photo(page: Page): Promise<string> {
  await asOnOthers(page);
  const file = path.join(stage.stack.folder(), 'photo.png');
  await page.screenshot(file);
  return readFileSync(file).toString('base64');
}

async function whole(page: Page, { width, height }: Viewport, scale: number): Promise<Part> {
  return { png: await photo(page), x: 0, y: 0, width, height, scale };
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
    scale: 1,
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
    await write(page, 'guide-stale', 'down', await whole(page, LAPTOP, 0.75));
    source.signal('SIGCONT');
    await is(page, 'HOLDING');
    await edge.kill();
    await is(page, 'OFFLINE');
    words.push(await around(page, chip, 8));
    await write(page, 'guide-words', 'down', ...words);
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
    await page.findByRole('button', /^Right knee is blocked/).click();
    const card = page.findByTestId('joint-card');
    await until('its card', async () => (await card.count()) === 1);
    const points = () =>
      page.evaluate<number>('document.querySelector(".trace-pos").getAttribute("d").split(/[ML]/).length');
    await until('a strip', async () => (await points()) > 150, 60_000);
    await write(page, 'guide-fault', 'down', await whole(page, PHONE, 1));

    await page.viewport(LAPTOP);
    for (const field of ['pos', 'ref', 'cur']) await page.findByTestId(`plot-${field}`).click();
    await page.findByRole('tab', /^Plots/).click();
    await until('three traces', () =>
      page.evaluate<boolean>('document.querySelectorAll("[data-testid=trace]").length === 3'),
    );
    const seq = () => page.evaluate<number>('window.posecast.twin.seq');
    const before = await seq();
    await until('ten seconds of them', async () => (await seq()) > before + 300, 60_000);
    await write(page, 'guide-plot', 'down', await whole(page, LAPTOP, 0.75));
  }, 240_000);

  it('the demo robot on a laptop and on a phone', async () => {
    const relay = await stage.stack.relay();
    // thirty poses a second of which the body shows nothing, so that its picture is at rest
    const still = demoAt(JAMMED_S);
    const wave = { cur: { LKN: [1.2, 0.4] } };
    const { source } = stage.stack.fedEdge(relay, { ...still, wave }, DEMO);
    let steps = 0;
    // a step nobody sees, so that it is LIVE; after it all pixels of a picture at rest come in well before it is HOLDING
    const step = () => {
      steps += 1;
      const NK1 = (still.pos?.NK1 ?? 0) + (steps % 2) * 0.004;
      source.write(JSON.stringify({ ...still, pos: { ...still.pos, NK1 }, wave }));
    };
    const page = await stage.newPage();
    const parts: Part[] = [];
    for (const [theme, viewport] of [
      ['light', LAPTOP],
      ['dark', PHONE],
    ] as const) {
      await page.viewport(viewport);
      await page.open(`${relay.url}/?${theme}#/r/demo`);
      await shown(page);
      await choose(page, { theme });
      await until('its finest shells', () => finest(page), 60_000);
      await asOnOthers(page);
      await page.press('0'); // the first view again, in the room that there is now
      const part = await until('a fine picture of what is live', async () => {
        step();
        const live = async () => (await liveness(page)) === 'LIVE';
        await until('LIVE', live, 3000);
        await until('a picture at rest', () => resting(page), 3000);
        const taken = await whole(page, viewport, DEMO_HEIGHT / viewport.height);
        return (await live()) ? taken : null;
      });
      parts.push(part);
    }
    await write(page, 'demo', 'across', ...parts);
  }, 240_000);
});
