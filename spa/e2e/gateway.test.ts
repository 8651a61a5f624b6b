import { describe, expect, it } from 'vitest';
import { freePort } from './driver/free_port.ts';
import { until } from './driver/until.ts';
import { chips, chipText, liveness, RECORD, SWINGING, shownPositions } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** A swinging knee, because unchanged poses would be HOLDING. */

describe('a gateway and its Redis', () => {
  it('without Redis it is STALE "relay degraded", and LIVE again by itself, frozen or killed', async () => {
    const port = await freePort();
    const store = `redis://127.0.0.1:${port}`;
    let redis = await stage.stack.redisOn(port);
    const ingest = await stage.stack.relay({ role: 'ingest', store });
    const gateway = await stage.stack.relay({ role: 'gateway', store });
    stage.stack.fedEdge(ingest, SWINGING);
    const page = await stage.newPage({ preload: RECORD });
    page.forgive(/status of 503 .*\/past$/); // it may ask for the past while there is no Redis to ask
    await page.open(`${gateway.url}/#/r/demo`);
    const is = (word: string) => async () => (await liveness(page)) === word;
    await until('LIVE', is('LIVE'));
    const before = (await chips(page)).length; // the page may have opened before the robot connected

    const harms = [
      { harm: () => redis.signal('SIGSTOP'), mend: () => redis.signal('SIGCONT') },
      {
        harm: () => redis.kill(),
        mend: async () => {
          redis = await stage.stack.redisOn(port);
        },
      },
    ];
    for (const { harm, mend } of harms) {
      await harm();
      await until('STALE', is('STALE'));
      await until('it says why', async () => /relay degraded/i.test(await chipText(page)));
      const last = Math.max(...(await shownPositions(page)).keys());
      await mend();
      await until('LIVE again', is('LIVE'));
      await until('newer poses', async () => Math.max(...(await shownPositions(page)).keys()) > last + 10);
    }
    expect((await chips(page)).slice(before).map((change) => change.state)).not.toContain('OFFLINE');
  });
});
