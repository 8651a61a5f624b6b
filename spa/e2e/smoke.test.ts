import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { COUNT_DRAWS, drawCalls } from './draw_calls.ts';
import { engineName } from './driver/engines.ts';
import { until } from './driver/until.ts';
import { poseMatches } from './pose_check.ts';
import { cellNumber, hasSkin, is, RECORD, resting, shownPositions, shownSeq, there } from './robot_page.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();
const URDF = path.join(REPO, 'edge-agent/src/posecast_edge/demo_bundle/robot.urdf');
/** Software fills them, once the robot stands still. */
const FEW_PIXELS = { width: 900, height: 360 };
/** Three decimals are shown. */
const HALF_DIGIT = 0.0005 + 1e-9;

/** The tests that `make test` runs in every engine. */
describe('the whole path', () => {
  it('leads from the list to the numbers and the moving body, drawn in one call', async () => {
    const relay = await stage.stack.relay();
    const tap = stage.stack.tap(relay);
    const edge = stage.stack.edge(relay);
    const page = await stage.open(`${relay.url}/`, {
      preload: `${RECORD};${COUNT_DRAWS}`,
      viewport: FEW_PIXELS,
    });
    await until('a card', there(page, 'robot-demo'));
    const ofBody = () => page.requested.filter((url) => /\/(three|canvas2d)[.-]/.test(url));
    expect(ofBody(), 'no 3D before a robot is chosen').toEqual([]);
    await page.findByRole('link', /demo/i).click();
    await until('3D is asked for', () => ofBody().length > 0);
    await until('LIVE', is(page, 'LIVE', 'HOLDING'));

    const shown = await until('frames that the tap has too', async () => {
      const rows = [...(await shownPositions(page))].filter(([seq]) => tap.frame(seq) !== undefined);
      return rows.length >= 5 ? rows : null;
    });
    for (const [seq, cells] of shown) {
      expect(Object.keys(cells).length, `rows of frame ${seq}`).toBeGreaterThan(3);
      for (const [joint, cell] of Object.entries(cells)) {
        const value = tap.frame(seq)?.values.pos?.[joint] ?? null;
        const far = Math.abs((cellNumber(cell) ?? Number.NaN) - (value ?? Number.NaN));
        if (value !== null) expect(far, `${joint} of frame ${seq}`).toBeLessThanOrEqual(HALF_DIGIT);
      }
    }

    await until('a body', () => hasSkin(page));
    const first = await poseMatches(page, edge, tap, URDF);
    await until('newer frames', async () => ((await shownSeq(page)) ?? -1) > first + 30);
    expect(await poseMatches(page, edge, tap, URDF)).toBeGreaterThan(first);

    edge.signal('SIGSTOP');
    await until('it stands still', is(page, 'STALE', 'OFFLINE'));
    await until('the colour has drained', () => resting(page));
    await page.evaluate('window.painting = true');
    const calls = await drawCalls(page);
    await page.screenshot(`smoke-${engineName()}.png`);
    edge.signal('SIGCONT');
    console.log(`${stage.browser.engine} ${stage.browser.version}: ${JSON.stringify(calls)} draw calls`);
    expect(calls.colors, 'a body in light and shade').toBeGreaterThan(100);
    expect(calls.bones).toBe(1);
    expect(calls.all).toBe(calls.three); // nothing is split in transit
    expect(calls.all).toBeLessThanOrEqual(20);
  });
});
