import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { type Fault, FaultyLink } from './proxy.ts';
import { chips, chipText, is, RECORD, SWINGING, shownSeq } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

/** The browser's message about a WebSocket that a proxy has turned into an ordinary request. */
const NO_UPGRADE = /WebSocket|status of 40\d/;

async function behind(fault: Fault): Promise<{ link: FaultyLink; page: Page }> {
  const relay = await stage.stack.relay();
  stage.stack.fedEdge(relay, SWINGING);
  const link = await FaultyLink.open(relay.port);
  link.fault(fault);
  const page = await stage.newPage({ preload: RECORD });
  page.forgive(NO_UPGRADE);
  await page.open(`${link.url}/#/r/demo`);
  return { link, page };
}

const carrier = (page: Page) => page.evaluate<string | null>('window.posecast?.link?.carrier ?? null');

describe('where no WebSocket gets through', () => {
  it('the page reads events over HTTP and says so; it goes back to a WebSocket when it can', async () => {
    const { link, page } = await behind({ stripUpgrade: true });
    try {
      await until('LIVE', is(page, 'LIVE'));
      expect(await carrier(page)).toBe('events');
      expect(await chipText(page)).toMatch(/over HTTP/);
      await page.findByTestId('liveness').click();
      await until('why', async () =>
        /comes over HTTP/.test(await page.findByTestId('liveness-explained').text()),
      );
      const before = (await chips(page)).length;

      link.heal();
      await page.evaluate(`window.dispatchEvent(new Event('online'))`);
      await until('a WebSocket', async () => (await carrier(page)) === 'websocket');
      await until('still LIVE', is(page, 'LIVE'));
      const words = (await chips(page)).slice(before).map(({ state }) => state);
      expect(words, 'nobody notices').not.toContain('OFFLINE');
    } finally {
      await link.close();
    }
  });

  it.skipIf(!FULL)('a proxy with a buffer of a few kilobytes in it brings poses in bursts', async () => {
    const { link, page } = await behind({ stripUpgrade: true });
    try {
      await until('LIVE', is(page, 'LIVE'));
      link.fault({ stripUpgrade: true, gatherBytes: 2048 });
      const seen = (await shownSeq(page)) ?? 0;
      await until('poses of the bursts', async () => ((await shownSeq(page)) ?? 0) > seen + 90);
      await until('LIVE in between', is(page, 'LIVE'));
      expect(await carrier(page)).toBe('events');
    } finally {
      await link.close();
    }
  });

  it.skipIf(!FULL)(
    'a line too narrow for the stream: never an old pose as live, then fewer of them, and it says why',
    async () => {
      const { link, page } = await behind({ stripUpgrade: true });
      try {
        await until('LIVE', is(page, 'LIVE'));
        link.fault({ stripUpgrade: true, bytesPerSecond: 1000 });
        await until('STALE', is(page, 'STALE'));
        await until(
          'a lower rate',
          async () => ((await page.evaluate<number>('window.posecast.link.granted_hz')) ?? 30) <= 10,
        );
        await until('LIVE again', is(page, 'LIVE'));
        await page.findByTestId('liveness').click();
        await until('why', async () =>
          /\d Hz: slow network/.test(await page.findByTestId('liveness-explained').text()),
        );

        link.fault({ stripUpgrade: true });
        await page.findByTestId('wish-all').click();
        await until(
          'every pose',
          async () => (await page.evaluate<number>('window.posecast.link.granted_hz')) === 30,
        );
      } finally {
        await link.close();
      }
    },
  );
});

describe('a dead socket that nobody told us about', () => {
  it('is noticed and replaced', async () => {
    const { link, page } = await behind({});
    try {
      await until('LIVE', is(page, 'LIVE'));
      link.strand();
      await until('STALE', is(page, 'STALE'));
      await until('LIVE on another', is(page, 'LIVE'));
    } finally {
      await link.close();
    }
  });
});
