import { execFileSync } from 'node:child_process';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { until } from '../driver/until.ts';
import { holds } from '../robot_page.ts';
import { demoOver } from '../sign_words.ts';
import { PYTHON, REPO } from '../stack.ts';
import { setStage } from '../stage.ts';
import { dressed, sharpPage, takeLive, WRITES } from './picture.ts';
import { PosedDemo } from './posed_demo.ts';

const stage = setStage({ paints: true });

/** The demo robot lifts a leg, and its knee jams. */
const FROM_S = 38.4;
const FRAMES = 60;
const EACH_MS = 100;
const SIZE = { width: 960, height: 540 };

/** The clock for the page's fault duration. Once the fault exists, it follows the robot's time, which runs slower here. Until
 *  then it is the machine's clock, like that of the relay, which timestamps the fault. */
const FAULT_CLOCK = `(() => {
  const now = Date.now;
  let base = null;
  let began = 0;
  window.setRobotMs = (ms) => {
    if (base === null && document.querySelector('[data-testid=fault-line][data-told]') !== null) {
      base = now();
      began = ms;
    }
    window.robotMs = ms;
  };
  Date.now = () => (base === null ? now() : base + window.robotMs - began);
})()`;

describe.runIf(WRITES)('the moving picture', () => {
  it('a knee jams', async () => {
    const moments = demoOver(Array.from({ length: FRAMES }, (_, i) => FROM_S + (i * EACH_MS) / 1000));
    const relay = await stage.stack.relay();
    const robot = new PosedDemo(stage.stack, relay, moments[0]!);
    const page = await sharpPage(
      stage,
      { theme: 'dark', panelPx: 380 },
      { viewport: SIZE, preload: FAULT_CLOCK },
    );
    await page.open(`${relay.url}/#/r/demo`);
    await dressed(page);
    const folder = stage.stack.folder();
    for (const [i, moment] of moments.entries()) {
      robot.show(moment);
      const reached = (moment.pos?.RKN ?? 0) - 0.002;
      await until(
        'the moment',
        holds(page, `Math.abs(window.posecast.twin.value('pos', 'RKN') - ${reached}) < 0.004`),
      );
      await page.evaluate(`window.setRobotMs(${i * EACH_MS})`);
      const file = path.join(folder, `${String(i).padStart(3, '0')}.png`);
      await takeLive(
        page,
        () => robot.stir(),
        () => page.screenshot(file).then(() => true),
      );
    }
    const out = path.join(REPO, 'docs/img/jam.webp');
    const said = execFileSync(PYTHON, ['-m', 'tools.moving_picture', folder, out, '--ms', String(EACH_MS)], {
      cwd: REPO,
    });
    console.log(said.toString().trim());
    expect(said.toString()).toMatch(/kB/);
  }, 600_000);
});
