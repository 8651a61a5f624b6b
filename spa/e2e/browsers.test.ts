import { describe, expect, it } from 'vitest';
import { type BrowserRow, otherThan, readReadme, withRow, writeReadme } from './browser_table.ts';
import { COUNT_DRAWS, drawCalls } from './draw_calls.ts';
import { openBrowser } from './driver/engines.ts';
import type { Ability, Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { finest, hasSkin, holds, renderedFrames, resting, there } from './robot_page.ts';
import { DEMO, demoAt } from './sign_words.ts';
import type { Relay } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const ROW: BrowserRow = {
  engine: 'firefox',
  version: '1.2',
  robotCalls: 1,
  allCalls: 4,
  touch: '✓',
  fullscreen: '✓',
  withoutWebGl: 'table',
  lacks: ['files'],
};
const EMPTY = 'Before.\n\n<!-- browsers: written by `make browsers` -->\n<!-- /browsers -->\n\nAfter.\n';

describe("the README's table of browsers", () => {
  it('takes each row once, in order, and leaves the rest', () => {
    const once = withRow(withRow(EMPTY, ROW), { ...ROW, engine: 'chromium' });
    expect(once).toMatch(/^Before\.[\s\S]*\| Chromium \| 1\.2 [\s\S]*\| Firefox \| 1\.2 [\s\S]*After\.\n$/);
    expect(withRow(once, ROW)).toBe(once);
    expect(() => withRow('no table', ROW)).toThrow(/README/);
  });

  it('is compared by what was found, not by the version', () => {
    const written = withRow(EMPTY, ROW);
    expect(otherThan(written, { ...ROW, version: '1.3' })).toBeNull();
    expect(otherThan(written, { ...ROW, robotCalls: 61 })).toContain('1 draw call,');
    expect(otherThan(written, { ...ROW, lacks: [] })).toContain('files from the desktop |');
    expect(otherThan(written, { ...ROW, engine: 'webkitgtk' })).toBe('nothing');
  });

  it('says what this browser does', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, demoAt(1), DEMO); // stands still, so that pictures can be counted
    const touch = stage.browser.lacks.touch === undefined;
    const page = await stage.open(`${relay.url}/#/r/demo`, { preload: COUNT_DRAWS, touch });
    await until('its finest shells', () => finest(page));
    await until('its signs', there(page, 'level'));
    await until('it rests', () => resting(page));
    const calls = await drawCalls(page);
    const row: BrowserRow = {
      engine: stage.browser.engine,
      version: stage.browser.version,
      robotCalls: calls.bones,
      allCalls: calls.all,
      touch: touch ? await turnedByFinger(page) : 'not tested: its driver has no touch',
      fullscreen: await fullscreen(page),
      withoutWebGl: await withoutWebGl(relay),
      lacks: Object.keys(stage.browser.lacks) as Ability[],
    };
    if (process.env.POSECAST_WRITE_BROWSERS === '1') writeReadme(withRow(readReadme(), row));
    const other = otherThan(readReadme(), row);
    expect(other, `make browsers writes what was found: ${JSON.stringify(row)}`).toBeNull();
  });
});

async function turnedByFinger(page: Page): Promise<string> {
  const before = await renderedFrames(page);
  const { x, y } = await page.evaluate<{ x: number; y: number }>(`(() => {
    const { left, top, width, height } = document.querySelector('canvas').getBoundingClientRect();
    return { x: left + width / 2, y: top + height / 2 };
  })()`);
  await page.touch({ from: { x, y }, to: { x: x + 120, y } });
  await until('the camera has turned', async () => (await renderedFrames(page)) > before);
  return '✓';
}

async function fullscreen(page: Page): Promise<string> {
  const state = () => page.findByTestId('robot-page').attribute('data-fullscreen');
  await page.findByRole('button', 'Fullscreen').click();
  const found = await until('fullscreen', async () => {
    const now = await state();
    return now === 'off' ? null : now;
  });
  return found === 'screen' ? '✓' : 'the body alone in the page';
}

/** What is shown instead of a 3D view. */
async function withoutWebGl(relay: Relay): Promise<string> {
  const browser = await openBrowser({ webgl: false });
  try {
    const page = await browser.newPage();
    await page.open(`${relay.url}/#/r/demo`);
    await until('numbers', holds(page, 'document.querySelector("[data-field=pos]") !== null'));
    const flat = await until('the body, or why there is none', async () => {
      if ((await page.findByTestId('no-scene').count()) > 0) return 'table only';
      return (await hasSkin(page)) ? '✓ drawn in 2D, with the table' : null;
    });
    await page.close();
    return flat;
  } finally {
    await browser.close();
  }
}
