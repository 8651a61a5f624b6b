import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { is, shownSeq } from './robot_page.ts';
import type { Relay } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** What the relay sends to a page that requests nothing. */
const NOTHING = 0;

const grantedHz = (page: Page, of = 'window') =>
  page.evaluate<number | null>(`${of}.posecast?.link?.granted_hz ?? null`);
const seqOf = (page: Page, of: string) => page.evaluate<number | null>(`${of}.posecast?.twin?.seq ?? null`);

async function newestSeq(relay: Relay): Promise<number> {
  const { seq } = (await relay.json('/api/v1/robots/demo/state')) as { seq: number };
  return seq;
}

/** The page at `of` catches up with the robot's present, without replaying what it missed. */
async function comesBack(page: Page, relay: Relay, of: string, missedFrom: number): Promise<void> {
  const newest = await newestSeq(relay);
  expect(newest, 'the robot went on').toBeGreaterThan(missedFrom + 15);
  await until('the newest state is back', async () => ((await seqOf(page, of)) ?? -1) >= newest);
}

describe('a page that nobody sees', () => {
  it('behind another tab asks for no poses, and comes back with the newest', async () => {
    const relay = await stage.demo();
    const page = await stage.open(`${relay.url}/#/r/demo`);
    await until('LIVE', is(page, 'LIVE'));
    // A headless browser has no other tab to bring to the front, so the page is told that there is one.
    const hide = (hidden: boolean) =>
      page.evaluate(`(() => {
        Object.defineProperty(document, 'hidden', { value: ${hidden}, configurable: true });
        document.dispatchEvent(new Event('visibilitychange'));
      })()`);
    await hide(true);
    await until('asks for nothing', async () => (await grantedHz(page)) === NOTHING);
    const stood = (await shownSeq(page)) ?? -1;
    await until('the robot went on', async () => (await newestSeq(relay)) > stood + 30);
    expect((await shownSeq(page)) ?? -1, 'poses while hidden').toBeLessThanOrEqual(stood + 5);
    await hide(false);
    await comesBack(page, relay, 'window', stood);
    await until('LIVE again', is(page, 'LIVE'));
  });

  it('in an iframe that is scrolled away asks for no poses, and comes back with the newest', async () => {
    const relay = await stage.demo();
    const page = await stage.open(`${relay.url}/#/`);
    await page.evaluate(`(() => {
      const room = document.createElement('div');
      const frame = document.createElement('iframe');
      room.style.height = '3000px';
      frame.style.height = '400px';
      frame.src = './embed/?inside#/r/demo';
      document.body.replaceChildren(room, frame);
      for (const { style } of [document.documentElement, document.body]) style.cssText = 'height: auto; overflow: auto';
      scrollTo(0, 1e6);
    })()`);
    const inside = 'window.frames[0]';
    await until('it runs', async () => ((await seqOf(page, inside)) ?? -1) > 0);
    await page.evaluate('scrollTo(0, 0)');
    await until('asks for nothing', async () => (await grantedHz(page, inside)) === NOTHING);
    const stood = (await seqOf(page, inside)) ?? -1;
    await until('the robot went on', async () => (await newestSeq(relay)) > stood + 30);
    expect((await seqOf(page, inside)) ?? -1, 'poses off the screen').toBeLessThanOrEqual(stood + 5);
    await page.evaluate('scrollTo(0, 1e6)');
    await comesBack(page, relay, inside, stood);
  });
});
