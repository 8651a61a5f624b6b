import { execFile } from 'node:child_process';
import { promisify } from 'node:util';
import { describe, expect, it } from 'vitest';
import { CLOUD } from './cloud.ts';
import { engineName } from './driver/engines.ts';
import { until } from './driver/until.ts';
import { liveness, RECORD, shownSeq } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** A script that replaces what serves the page, and for how long the page may say that it is not live meanwhile, ms. */
const { POSECAST_UPGRADE, POSECAST_STALE_MS = '0' } = process.env;

/** Notes the number of each frame that the table shows, in order. */
const NOTE_SEQS = `${RECORD};(() => {
  const seqs = [];
  window.shownSeqs = seqs;
  new MutationObserver(() => {
    const seq = Number(document.querySelector('[data-seq]')?.dataset.seq || NaN);
    if (!Number.isNaN(seq) && seq !== seqs.at(-1)) seqs.push(seq);
  }).observe(document, { subtree: true, childList: true, attributes: true, attributeFilter: ['data-seq'] });
})()`;

const isLive = (state: string) => ['LIVE', 'HOLDING'].includes(state);

describe('a page that watches while what serves it is replaced', () => {
  it('says that it is not live for no longer than it may, and shows no frame twice', async (context) => {
    if (CLOUD === null || POSECAST_UPGRADE === undefined)
      return context.skip('make compose-test has a cloud, and what replaces a part of it');
    if (engineName() !== 'chromium')
      context.skip('only Chromium takes a certificate of an unknown authority');
    const page = await stage.newPage({ preload: NOTE_SEQS });
    await page.open(`${CLOUD.url}/#/r/demo`);
    await until('LIVE', async () => isLive(await liveness(page)), 60_000);
    const begun = await page.evaluate<number>('window.recorded.chips.length');
    const first = (await shownSeq(page)) ?? 0;
    await until('frames', async () => ((await shownSeq(page)) ?? 0) > first + 60);

    await promisify(execFile)('bash', ['-euc', POSECAST_UPGRADE], { timeout: 300_000 });
    await until('LIVE afterwards', async () => isLive(await liveness(page)), 60_000);
    const last = (await shownSeq(page)) ?? 0;
    await until('frames afterwards', async () => ((await shownSeq(page)) ?? 0) > last + 60, 60_000);

    const chips = await page.evaluate<{ atMs: number; state: string }[]>('window.recorded.chips');
    const nowMs = await page.evaluate<number>('Date.now()');
    const words = chips.slice(begun).map(({ state, atMs }, i, all) => ({
      state,
      ms: (all[i + 1]?.atMs ?? nowMs) - atMs,
    }));
    const lostMs = words.reduce((sum, { state, ms }) => sum + (isLive(state) ? 0 : ms), 0);
    console.info(`not live for ${lostMs} ms: ${JSON.stringify(words)}`);
    expect(lostMs).toBeLessThanOrEqual(Number(POSECAST_STALE_MS));

    const seqs = await page.evaluate<number[]>('window.shownSeqs');
    expect(seqs.length).toBeGreaterThan(60);
    expect(seqs).toEqual([...new Set(seqs)].sort((a, b) => a - b));
  }, 420_000);
});
