import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { is } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** The age of the pose in the page at the moment it changes, ms; the source timestamps its samples with this machine's clock. */
const WATCH_AGES = `(() => {
  window.ages = [];
  window.times = [];
  let last = null;
  setInterval(() => {
    const t_s = window.posecast?.twin?.t_s ?? null;
    if (t_s !== null && t_s !== last) {
      window.ages.push(Date.now() - t_s * 1000);
      window.times.push(t_s);
    }
    last = t_s;
  }, 2);
})()`;

describe('from the robot to the browser', () => {
  it('every pose is a newer one, and how old each is then is told', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, { pos: { RKN: 0 }, wave: { pos: { RKN: [0.4, 0.5] } } }, { hz: 30 });
    const page = await stage.newPage();
    await page.open(`${relay.url}/#/r/demo`);
    await until('LIVE', is(page, 'LIVE'));
    await page.evaluate(WATCH_AGES);
    const ages = await until(
      'a hundred frames',
      async () => {
        const seen = await page.evaluate<number[]>('window.ages');
        return seen.length >= 100 ? seen.sort((a, b) => a - b) : null;
      },
      30_000,
    );
    const [p50, p99] = [ages[50] ?? 0, ages[98] ?? 0];
    console.log(`sample to decoded in the page: p50 ${p50.toFixed(0)} ms, p99 ${p99.toFixed(0)} ms`);
    const times = await page.evaluate<number[]>('window.times');
    expect(times).toEqual(times.toSorted((a, b) => a - b));
  });
});
