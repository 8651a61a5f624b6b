import { execFile } from 'node:child_process';
import { promisify } from 'node:util';
import { describe, expect, it } from 'vitest';
import { CLOUD } from './cloud.ts';
import { engineName } from './driver/engines.ts';
import { until } from './driver/until.ts';
import { liveness, shownSeq } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** A script that replaces the server of the page, and the maximum number of robot frames between the last one before the page
 *  says that it is not live and the first one after. */
const { POSECAST_UPGRADE, POSECAST_MAY_MISS } = process.env;

interface Noted {
  readonly state: string;
  /** The reason that it is not live; '' also if a busy machine held up the page itself. */
  readonly cause: string;
  /** The displayed frame. */
  readonly seq: number | null;
}

/** Records the number of each frame that the table shows, in order, and each word of the chip with the frame shown at that
 *  time. */
const NOTE = `(() => {
  const seqs = [], words = [];
  Object.assign(window, { shownSeqs: seqs, shownWords: words });
  new MutationObserver(() => {
    const seq = Number(document.querySelector('[data-seq]')?.dataset.seq || NaN);
    if (!Number.isNaN(seq) && seq !== seqs.at(-1)) seqs.push(seq);
    const { state = '', cause = '' } = document.querySelector('[data-testid="liveness"]')?.dataset ?? {};
    const last = words.at(-1);
    if (last?.state !== state || last.cause !== cause) words.push({ state, cause, seq: seqs.at(-1) ?? null });
  }).observe(document, {
    subtree: true, childList: true, attributes: true, attributeFilter: ['data-state', 'data-cause', 'data-seq'],
  });
})()`;

const isLive = (state: string) => ['LIVE', 'HOLDING'].includes(state);

describe('a page that watches while what serves it is replaced', () => {
  it('says that it is not live for no longer than it may, and shows no frame twice', async (context) => {
    if (CLOUD === null || POSECAST_UPGRADE === undefined)
      return context.skip('make compose-test has a cloud, and what replaces a part of it');
    if (engineName() !== 'chromium')
      context.skip('only Chromium takes a certificate of an unknown authority');
    const page = await stage.newPage({ preload: NOTE });
    page.forgive(/status of 503/); // it has just started and may need a moment, so the request is repeated
    await page.open(`${CLOUD.url}/#/r/demo`);
    await until('LIVE', async () => isLive(await liveness(page)));
    const begun = await page.evaluate<number>('window.shownWords.length');
    const first = (await shownSeq(page)) ?? 0;
    await until('frames', async () => ((await shownSeq(page)) ?? 0) > first + 60);

    await promisify(execFile)('bash', ['-euc', POSECAST_UPGRADE], { timeout: 300_000 });
    await until('LIVE afterwards', async () => isLive(await liveness(page)));
    const last = (await shownSeq(page)) ?? 0;
    await until('frames afterwards', async () => ((await shownSeq(page)) ?? 0) > last + 60);

    const words = (await page.evaluate<Noted[]>('window.shownWords')).slice(begun);
    console.info(JSON.stringify(words));
    expect(words.length === 0 || isLive(words.at(-1)?.state ?? '')).toBe(true);
    // counted in robot frames: a busy machine slows the robot down as well
    const missed = words.flatMap(({ state, cause, seq }, i) => {
      const next = words.slice(i).find((word) => isLive(word.state));
      return isLive(state) || cause === '' ? [] : [(next?.seq ?? Number.POSITIVE_INFINITY) - (seq ?? 0)];
    });
    for (const frames of missed) expect(frames).toBeLessThanOrEqual(Number(POSECAST_MAY_MISS));

    const seqs = await page.evaluate<number[]>('window.shownSeqs');
    expect(seqs.length).toBeGreaterThan(30);
    expect(seqs).toEqual([...new Set(seqs)].sort((a, b) => a - b));
  }, 420_000);
});
