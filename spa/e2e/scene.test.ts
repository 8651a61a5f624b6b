import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { drawsNothing, finest, hasSkin, is, liveness, renderedFrames, resting } from './robot_page.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const EDGE = path.join(REPO, 'edge-agent/src/posecast_edge');

describe('the body', () => {
  it('draws nothing while nothing changes, and says HOLDING', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(
      relay,
      { pos: { RKN: 0.3, LKN: 0.3 } },
      { urdf: path.join(EDGE, 'demo_bundle/robot.urdf') },
    );
    const page = await stage.open(`${relay.url}/#/r/demo`);
    await until('a body', async () => (await renderedFrames(page)) > 0);
    await until('HOLDING', is(page, 'HOLDING'));
    await until('the camera has come to rest', () => resting(page));
    await until('the finest shells', () => finest(page));
    await until('at rest again', () => resting(page));
    await drawsNothing(page, 10); // one each half second
    expect(await liveness(page)).toBe('HOLDING');
  });

  it('keeps its signs in the colours of the system', async (context) => {
    stage.needs(context, 'colors');
    const relay = await stage.stack.demo();
    const page = await stage.open(`${relay.url}/#/r/demo`, { media: { colors: 'forced' } });
    await until('a body', () => hasSkin(page));
    expect(await page.evaluate<boolean>(`matchMedia('(forced-colors: active)').matches`)).toBe(true);
    await page.screenshot('forced-laptop.png');
    // Shapes cut out of a background must keep their background, or they would be invisible. An SVG's clip cuts a drawing, not a
    // background.
    const lost = await page.evaluate<string[]>(`[...document.querySelectorAll('*')].flatMap((element) => {
      const style = getComputedStyle(element);
      return style.clipPath !== 'none' && !(element instanceof SVGElement) && !element.classList.contains('unseen') && style.forcedColorAdjust !== 'none' ? [element.className] : [];
    })`);
    expect(lost).toEqual([]);
  });
});
