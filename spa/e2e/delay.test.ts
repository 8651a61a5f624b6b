import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { type Fault, FaultyLink } from './proxy.ts';
import { chips, chipText, is, RECORD, SWINGING, shownSeq } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const swinging = stage.share(async (stack) => {
  const relay = await stack.relay();
  stack.fedEdge(relay, SWINGING);
  return relay;
});
const LOOKS = 15;
/** The browser's message about a WebSocket that a proxy has turned into an ordinary request, or that does not open in time. */
const NO_UPGRADE = /WebSocket|status of 40\d/;

async function behind(fault: Fault): Promise<{ link: FaultyLink; page: Page }> {
  const relay = await swinging();
  const link = await FaultyLink.open(relay.port);
  link.fault(fault);
  const page = await stage.newPage({ preload: RECORD });
  page.forgive(NO_UPGRADE);
  await page.open(`${link.url}/#/r/demo`);
  return { link, page };
}

/** What the chip says, in many looks while new poses arrive. `begins`: what makes it begin again. */
async function look(page: Page, begins = (_text: string) => false): Promise<string[]> {
  let texts: string[] = [];
  let seq = (await shownSeq(page)) ?? 0;
  while (texts.length < LOOKS) {
    await until('new poses', async () => ((await shownSeq(page)) ?? 0) > seq + 3);
    seq = (await shownSeq(page)) ?? 0;
    const text = await chipText(page);
    texts = begins(text) ? [] : [...texts, text];
  }
  return texts;
}

describe.each([
  ['websocket', {}],
  ['events', { stripUpgrade: true }],
] as const)('by %s', (carrier, fault) => {
  const isOn = async (page: Page) =>
    (await page.evaluate<string | null>('window.posecast?.link?.carrier ?? null')) === carrier;

  it('a stream that is steadily 4 s late is never called LIVE', async () => {
    const { link, page } = await behind({ ...fault, streamDelayMs: 4000 });
    try {
      await until('a pose', async () => (await shownSeq(page)) !== null);
      expect(await isOn(page)).toBe(true);
      // a busy machine adds pauses of its own, for which there is no connection
      await until('why', async () => /^STALE\d+\.\d s: slow network/.test(await chipText(page)));
      for (const text of await look(page)) expect(text).toMatch(/^STALE\d/);
      expect((await chips(page)).map(({ state }) => state)).not.toContain('LIVE');
      await page.findByTestId('liveness').click();
      await until('why', async () =>
        /holds them back/.test(await page.findByTestId('liveness-explained').text()),
      );
      link.fault(fault);
      await until('LIVE, as soon as it is on time', is(page, 'LIVE'));
    } finally {
      await link.close();
    }
  });

  it('a healthy stream with a round trip of 600 ms stays LIVE', async () => {
    const { link, page } = await behind({ ...fault, delayMs: 300 });
    try {
      await until('LIVE', is(page, 'LIVE'));
      expect(await isOn(page)).toBe(true);
      await until('its delay is known well', async () => /^LIVE\d+ Hz · \d+ ms/.test(await chipText(page)));
      // on a busy machine, again after each pause of its own
      const texts = await look(page, (text) => !text.startsWith('LIVE'));
      expect(texts).toHaveLength(LOOKS);
    } finally {
      await link.close();
    }
  });
});
