/** The robot page as read by tests: its chip over time, its table by frame, its body. */

import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';

export interface ChipChange {
  /** Unix time, ms; comparable with the test's clock, because it is the same machine. */
  readonly atMs: number;
  readonly state: string;
  readonly text: string;
}

export interface Body {
  readonly seq: number;
  readonly links: Readonly<Record<string, readonly number[]>>;
}

/** A knee that swings: an unchanged pose would be HOLDING. */
export const SWINGING = { pos: { RKN: 0, LKN: 0.2 }, wave: { pos: { RKN: [0.4, 0.5] } } };

/** An expression for the element with this test id. */
export const testId = (id: string) => `document.querySelector('[data-testid="${id}"]')`;
/** All of its text, visible or not; '' if there is no such element. */
export const textOf = (page: Page, id: string) => page.evaluate<string>(`${testId(id)}?.textContent ?? ''`);

// Probes for `until`.
export const is =
  (page: Page, ...words: readonly string[]) =>
  async () =>
    words.includes(await liveness(page));
export const there = (page: Page, id: string) => async () => (await page.findByTestId(id).count()) > 0;
export const gone = (page: Page, id: string) => async () => (await page.findByTestId(id).count()) === 0;
export const holds = (page: Page, expression: string) => () => page.evaluate<boolean>(expression);

/** Runs before the page's own scripts: records every change of every liveness chip and every frame that the table shows. */
export const RECORD = `(() => {
  const chips = [], rows = new Map();
  window.recorded = { chips, rows };
  const last = new Map();
  const note = () => {
    for (const chip of document.querySelectorAll('[data-testid="liveness"]')) {
      const state = chip.dataset.state ?? '';
      if (last.get(chip) === state) continue;
      last.set(chip, state);
      chips.push({ atMs: Date.now(), state, text: chip.textContent ?? '' });
    }
    for (const table of document.querySelectorAll('[data-seq]')) {
      const seq = Number(table.dataset.seq);
      if (!table.dataset.seq || rows.has(seq)) continue;
      // for rows on screen: others are written in turns
      const room = (table.closest('.table-room') ?? document.body).getBoundingClientRect();
      const cells = {};
      for (const cell of table.querySelectorAll('[data-field="pos"]')) {
        const { top, bottom } = cell.getBoundingClientRect();
        if (top >= room.top && bottom <= room.bottom && bottom <= innerHeight) cells[cell.dataset.label] = cell.textContent;
      }
      rows.set(seq, cells);
      if (rows.size > 200) rows.delete(rows.keys().next().value);
    }
  };
  new MutationObserver(note).observe(document, {
    subtree: true, childList: true, characterData: true, attributes: true, attributeFilter: ['data-state', 'data-seq'],
  });
})()`;

/** Opens the notices about the picture, once there are some. */
export const openNotices = (page: Page) =>
  until(
    'notices',
    holds(
      page,
      `(() => {
      const notices = document.querySelector('.notices');
      if (notices?.dataset.open === 'false') notices.querySelector('button').click();
      return notices?.dataset.open === 'true';
    })()`,
    ),
  );

/** All states of the chips, oldest first. */
export function chips(page: Page): Promise<ChipChange[]> {
  return page.evaluate<ChipChange[]>('window.recorded.chips');
}

/** The chip's current word, '' if there is no chip. */
export function liveness(page: Page): Promise<string> {
  return page.evaluate<string>('document.querySelector(\'[data-testid="liveness"]\')?.dataset.state ?? ""');
}

export function chipText(page: Page): Promise<string> {
  return page.evaluate<string>('document.querySelector(\'[data-testid="liveness"]\')?.textContent ?? ""');
}

/** seq → joint → text of its position cell, for the newest 200 frames the table has shown. */
export async function shownPositions(page: Page): Promise<Map<number, Record<string, string>>> {
  return new Map(await page.evaluate<[number, Record<string, string>][]>('[...window.recorded.rows]'));
}

/** The number in a table cell, without its special minus sign, padding and unit; null for "no reading". */
export function cellNumber(text: string): number | null {
  const found = text.replace('\u2212', '-').match(/-?\d+(\.\d+)?/);
  return found === null ? null : Number(found[0]);
}

export function shownSeq(page: Page): Promise<number | null> {
  return page.evaluate<number | null>('window.posecast?.twin?.seq ?? null');
}

/** Every link's pose in the world as the scene has it, with the frame the page stands at. */
export function body(page: Page): Promise<Body | null> {
  return page.evaluate<Body | null>(`(() => {
    const { twin, scene } = window.posecast ?? {};
    return scene ? { seq: twin.seq, links: scene.linkPoses() } : null;
  })()`);
}

export function renderedFrames(page: Page): Promise<number> {
  return page.evaluate<number>('window.posecast?.scene?.renderedFrames ?? -1');
}

/** Whether the body is at rest: it shows the newest pose, and no picture is requested. */
export function resting(page: Page): Promise<boolean> {
  return page.evaluate<boolean>('window.posecast?.scene?.resting ?? false');
}

/** Whether the robot has the finest meshes that it will get: until then, a finer level may still load automatically. A machine
 *  that is slow in 3D keeps the coarsest. For a model with two levels. */
export async function finest(page: Page): Promise<boolean> {
  const settled = `window.posecast.scene.finerBytes === null || document.querySelector('[data-trouble="detail"]') !== null`;
  return (await hasSkin(page)) && (await page.evaluate<boolean>(settled));
}

/** Whether a level of the robot's meshes is in the picture, not just the skeleton. */
export function hasSkin(page: Page): Promise<boolean> {
  return page.evaluate<boolean>('(window.posecast?.scene?.triangles ?? 0) > 1000');
}

/** Whether the body has loaded, as far as it will before finer levels. */
export function whole(page: Page): Promise<boolean> {
  return page.evaluate<boolean>(
    `Object.keys(window.posecast?.scene?.linkPoses() ?? {}).length > 0 && document.querySelector('[data-testid="progress"]') === null`,
  );
}

/** Waits until this many consecutive frames of the robot have caused no picture; pending ones may come first. */
export async function drawsNothing(page: Page, frames: number): Promise<void> {
  await until(`${frames} frames without a picture`, async () => {
    const before = await renderedFrames(page);
    const seq = (await shownSeq(page)) ?? 0;
    await until('frames go on', async () => ((await shownSeq(page)) ?? 0) > seq + frames);
    return (await renderedFrames(page)) === before;
  });
}

/** Retries until it is recognised as a tap: on a busy machine, the time between down and up may be longer than a person's. */
export async function tapped(
  what: string,
  tap: () => Promise<void>,
  holds: () => Promise<boolean>,
): Promise<void> {
  await until(what, async () => {
    await tap();
    return until(what, holds, 3000).catch(() => false);
  });
}

/** Types into a field, as React sees it. `field`: an expression for the element. */
export const enter = (page: Page, field: string, value: string) =>
  page.evaluate(`(() => {
    const field = ${field};
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(field, ${JSON.stringify(value)});
    for (const kind of ['input', 'change']) field.dispatchEvent(new Event(kind, { bubbles: true }));
  })()`);

/** Keeps files that the page saves instead of downloading them: not every driver can find a download. */
export const KEEP_SAVED = `(() => {
  const blobs = new Map();
  const make = URL.createObjectURL;
  URL.createObjectURL = (blob) => {
    const url = make.call(URL, blob);
    blobs.set(url, blob);
    return url;
  };
  window.downloads = [];
  const click = HTMLAnchorElement.prototype.click;
  HTMLAnchorElement.prototype.click = function () {
    if (this.download) window.downloads.push({ name: this.download, blob: blobs.get(this.href) });
    else click.call(this);
  };
})()`;

/** The files that a page with `KEEP_SAVED` has saved, and the newest. */
export const savedCount = (page: Page) => page.evaluate<number>('window.downloads.length');
export async function newestSaved(page: Page): Promise<{ name: string; bytes: Uint8Array }> {
  const name = await page.evaluate<string>('window.downloads.at(-1).name');
  const data = await page.evaluate<string>(`new Promise((resolve) => {
    const reader = new FileReader();
    reader.onload = () => resolve(reader.result.slice(reader.result.indexOf(',') + 1));
    reader.readAsDataURL(window.downloads.at(-1).blob);
  })`);
  return { name, bytes: Uint8Array.from(Buffer.from(data, 'base64')) };
}
