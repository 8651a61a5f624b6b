/** Pictures of the page for the docs, drawn as on a reader's device: `make pictures` writes them to docs/img. */

import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { expect } from 'vitest';
import type { Page, PageOptions, Viewport } from '../driver/page.ts';
import { until } from '../driver/until.ts';
import { finest, liveness, resting } from '../robot_page.ts';
import { REPO } from '../stack.ts';
import type { Stage } from '../stage.ts';

/** Whether to make the pictures; a plain run of the browser tests leaves docs/img as it is. */
export const WRITES = process.env.POSECAST_WRITE_PICTURES === '1';
export const LAPTOP = { width: 1280, height: 800 };
export const PHONE = { width: 390, height: 844 };

const MOST_BYTES = 150_000; // `tests/test_pictures.py` enforces this in the docs
const QUALITY = 0.86;
/** Between two pictures side by side. */
const GAP = 16;

/** The machine that makes the pictures renders in software, which the page treats as a slow device. Saved pictures have full
 *  resolution and detail, as on a device with a GPU. */
const KEEP_SHARP = `(() => {
  const looking = setInterval(() => {
    const scene = window.posecast?.scene;
    if (scene?.keepSharp === undefined) return;
    clearInterval(looking); // the page's idle work gets its turn again
    scene.keepSharp();
  }, 20);
})()`;

/** A part of a screenshot. */
export interface Part {
  readonly png: string;
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
  /** Pixels of the picture for one of the page's. */
  readonly scale: number;
}

export interface Rectangle {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

/** A page at full quality, with these settings. */
export function sharpPage(
  stage: Stage,
  settings: Record<string, unknown>,
  options: PageOptions = {},
): Promise<Page> {
  const chosen = JSON.stringify(JSON.stringify({ body: '3d', smooth: false, ...settings }));
  const keep = `try { localStorage.setItem('posecast.settings', ${chosen}) } catch {}`;
  const preload = [keep, KEEP_SHARP, options.preload ?? ''].join(';');
  return stage.newPage({ viewport: LAPTOP, ...options, preload });
}

/** Waits for a body with the finest detail; it presses the button with which a reader would load the last level. */
export async function dressed(page: Page): Promise<void> {
  await until('shells', () => finest(page), 60_000);
  const finer = page.findByTestId('finer');
  await until(
    'the tools beside the body',
    async () => (await page.findByRole('button', 'front').count()) === 1,
  );
  if ((await finer.count()) === 0) return;
  // not the driver's click, which moves the focus; with its position, because labels find clicks by position
  await page.evaluate(`(() => {
    const button = document.querySelector('[data-testid=finer] button');
    const { x, y } = button.getBoundingClientRect();
    button.dispatchEvent(new MouseEvent('click', { bubbles: true, clientX: x + 4, clientY: y + 4 }));
  })()`);
  await until('nothing finer', async () => (await finer.count()) === 0, 60_000);
}

/** Takes a picture once the body is at rest, and again unless the page said LIVE before and after. `stir` moves the robot
 *  invisibly, so that it does not count as holding. */
export function takeLive<T>(page: Page, stir: () => void, take: () => Promise<T>): Promise<T> {
  const live = async () => (await liveness(page)) === 'LIVE';
  return until(
    'a picture of what is live',
    async () => {
      if (!(await live())) {
        stir();
        await until('LIVE', live, 10_000);
      }
      await until('a picture at rest', () => resting(page), 20_000);
      const taken = await take();
      return (await live()) ? taken : null;
    },
    120_000,
  );
}

export async function whole(stage: Stage, page: Page, { width, height }: Viewport, scale = 1): Promise<Part> {
  return { png: await photograph(stage, page), x: 0, y: 0, width, height, scale };
}

export async function cut(stage: Stage, page: Page, at: Rectangle, scale = 1): Promise<Part> {
  return { png: await photograph(stage, page), ...at, scale };
}

/** The position of an element, with a small margin, CSS px. */
export async function around(page: Page, selector: string, room: number): Promise<Rectangle> {
  const box = await page.evaluate<Rectangle>(
    `(({ x, y, width, height }) => ({ x, y, width, height }))(document.querySelector(${JSON.stringify(selector)}).getBoundingClientRect())`,
  );
  return {
    x: Math.round(box.x - room),
    y: Math.round(box.y - room),
    width: Math.round(box.width + 2 * room),
    height: Math.round(box.height + 2 * room),
  };
}

/** Writes parts of pictures, one below the other or with a gap side by side, as docs/img/NAME.webp. */
export async function write(
  page: Page,
  name: string,
  way: 'down' | 'across',
  ...parts: Part[]
): Promise<void> {
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
    if (!across) {
      const [red, green, blue] = context.getImageData(0, 0, 1, 1).data;
      context.globalCompositeOperation = 'destination-over'; // parts of several widths: one background
      context.fillStyle = 'rgb(' + [red, green, blue] + ')';
      context.fillRect(0, 0, canvas.width, canvas.height);
    }
    return canvas.toDataURL('image/webp', ${QUALITY}).split(',')[1];
  })()`);
  const bytes = Buffer.from(webp, 'base64');
  expect(bytes.length, `${name} is small`).toBeLessThan(MOST_BYTES);
  writeFileSync(path.join(REPO, `docs/img/${name}.webp`), bytes);
  console.log(`${name}: ${(bytes.length / 1000).toFixed(0)} kB`);
}

/** The whole page as a PNG, base64. Fails if the page says its device is slow. */
async function photograph(stage: Stage, page: Page): Promise<string> {
  const notes = await page.evaluate<string[]>(
    `[...document.querySelectorAll('[data-testid=view-note]')].map((note) => note.textContent)`,
  );
  expect(
    notes.filter((note) => /slow/.test(note)),
    'no picture of a page in its slow mode',
  ).toEqual([]);
  const file = path.join(stage.stack.folder(), 'photo.png');
  await page.screenshot(file);
  return readFileSync(file).toString('base64');
}
