import { setTimeout as pause } from 'node:timers/promises';
import { describe, expect, it } from 'vitest';
import { type BuiltFiles, sampleChain, writeBuilt } from './built_model.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { body, holds } from './robot_page.ts';
import type { Relay } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();
const POSE = { pos: { joint1: 0.3 } };

const onAir = (relay: Relay, robot: string) =>
  until('on air', async () =>
    JSON.stringify(await relay.json('/api/v1/robots')).includes(`"robot":"${robot}","name"`),
  );
const linkCount = async (page: Page) => Object.keys((await body(page))?.links ?? {}).length;
const dressed = (page: Page) =>
  until('shells', holds(page, `performance.getEntriesByName('posecast:skin').length > 0`));

/** Bytes that this page has downloaded for the model. */
const modelBytes = (page: Page, file = '') =>
  page.evaluate<number>(
    `performance.getEntriesByType('resource').filter((e) => e.name.includes('/model/') && e.name.endsWith('${file}')).reduce((sum, e) => sum + e.transferSize, 0)`,
  );

const built = (parts: number): Promise<BuiltFiles> =>
  writeBuilt(stage.stack.folder(), sampleChain(parts), ['low']);

describe('a model', () => {
  it('that has changed reaches an open page, which is not loaded anew', async () => {
    const relay = await stage.stack.relay();
    const before = stage.stack.fedEdge(relay, POSE, { robot: 'demo', model: (await built(5)).folder });
    await onAir(relay, 'demo');
    const page = await stage.open(`${relay.url}/#/r/demo`);
    await until('the first model', async () => (await linkCount(page)) === 5);
    page.forgive(/Failed to load resource/); // requests to an edge that is just disconnecting
    await page.evaluate('window.stayed = true');
    await before.edge.stop();
    await before.source.stop();
    stage.stack.fedEdge(relay, POSE, { robot: 'demo', model: (await built(8)).folder });
    await until('the second model', async () => (await linkCount(page)) === 8);
    expect(await page.evaluate<boolean>('window.stayed === true')).toBe(true);
    await until('moving', async () => Math.abs((await body(page))?.links.link1?.[0] ?? 1) < 1);
  });

  it('costs a second visit not one byte', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, POSE, { robot: 'demo', model: (await built(12)).folder });
    await onAir(relay, 'demo');
    const page = await stage.open(`${relay.url}/#/r/demo`);
    await dressed(page);
    expect(await modelBytes(page)).toBeGreaterThan(1000);
    await until(
      'kept',
      holds(page, `caches.open('posecast-levels-1').then(async (c) => (await c.keys()).length === 1)`),
    );
    await page.open('about:blank');
    await page.open(`${relay.url}/#/r/demo`);
    await dressed(page);
    await pause(200); // the performance time line is updated a moment later
    expect(await modelBytes(page, '.glb'), 'shells, which the page keeps itself').toBe(0);
    if (stage.browser.lacks.cache === undefined) expect(await modelBytes(page)).toBe(0);
  });
});
