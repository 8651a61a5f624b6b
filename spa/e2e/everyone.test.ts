import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { hasSkin } from './robot_page.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const URDF = path.join(REPO, 'edge-agent/src/posecast_edge/demo_bundle/robot.urdf');

describe('those who listen', () => {
  it('are told how the robot is, and when that changes', async () => {
    const relay = await stage.stack.relay();
    const { source } = stage.stack.fedEdge(
      relay,
      { pos: { RKN: 0 }, wave: { pos: { RKN: [0.4, 0.5] } } },
      { urdf: URDF },
    );
    const page = await stage.newPage();
    await page.open(`${relay.url}/#/r/demo`);
    const said = () => page.findByTestId('spoken').text();
    await until('LIVE', async () => /: live/.test(await said()), 60_000);
    source.signal('SIGSTOP');
    await until('STALE', async () => /: stale, robot silent/.test(await said()), 30_000);
  });
});

describe('with the colours of the system', () => {
  it('signs stay signs', async (context) => {
    stage.needs(context, 'colors');
    const relay = await stage.stack.relay();
    stage.stack.edge(relay);
    const page = await stage.newPage({ media: { colors: 'forced' } });
    await page.open(`${relay.url}/#/r/demo`);
    await until('a body', () => hasSkin(page), 60_000);
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
