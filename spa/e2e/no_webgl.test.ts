import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { liveness, RECORD, shownPositions } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage({ webgl: false });

describe('a browser without 3D', () => {
  it('has a live table', async () => {
    const relay = await stage.stack.relay();
    stage.stack.edge(relay);
    const page = await stage.newPage({ preload: RECORD });
    page.forgive(/WebGL/); // the browser's own complaint when three asks for a context
    await page.open(`${relay.url}/#/r/demo`);
    expect(
      await page.evaluate<boolean>('document.createElement("canvas").getContext("webgl2") === null'),
    ).toBe(true);
    await until('LIVE', async () => ['LIVE', 'HOLDING'].includes(await liveness(page)));
    await until('a table that goes on', async () => (await shownPositions(page)).size > 20, 30_000);
    expect(await page.text()).toMatch(/no 3D/i);
  });
});
