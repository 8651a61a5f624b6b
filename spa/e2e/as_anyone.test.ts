import { execFileSync } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { there } from './robot_page.ts';
import { REPO } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
const POLICY = `[robots.demo.anyone]\nhz = 2\n[robots.demo.link]\n[robots.hidden.link]\n`;

const granted = (page: Page) => page.evaluate<number | null>('window.posecast?.link?.granted_hz ?? null');

describe.skipIf(!FULL)('who may see more', () => {
  it('sees with one click what anyone sees, and comes back', async () => {
    const robots = path.join(stage.stack.folder(), 'robots.toml');
    writeFileSync(robots, POLICY, { mode: 0o600 });
    const link = (robot: string) => {
      const words = ['robots', 'link', robot, '--robots', robots];
      return execFileSync(path.join(REPO, '.venv/bin/posecast-relay'), words, { encoding: 'utf8' }).trim();
    };
    const address = link('demo');
    const hidden = link('hidden');
    const relay = await stage.stack.demo({ robots });
    const page = await stage.open(`${relay.url}/${address}`);
    await until('all of it', async () => (await granted(page)) === 30);
    expect(await page.findByTestId('as-anyone').count()).toBe(0);

    await page.press('s');
    await until('the sheet', there(page, 'seen-by-anyone'));
    await page.screenshot('seen-by-anyone-laptop.png');
    await page.findByTestId('seen-by-anyone').click();
    await page.loaded();
    await until('what anyone gets', async () => (await granted(page)) === 2);
    await until('it says so', there(page, 'as-anyone'));
    await page.screenshot('as-anyone-laptop.png');
    await page.viewport({ width: 390, height: 844 });
    await page.screenshot('as-anyone-phone.png');

    await page.findByRole('link', /back to your view/i).click();
    await page.loaded();
    await until('all of it again', async () => (await granted(page)) === 30);
    expect(await page.findByTestId('as-anyone').count()).toBe(0);

    const other = await stage.open(`${relay.url}/?as=anyone${hidden}`);
    await until('nothing to be seen', async () =>
      /no robot here has this name/i.test(await other.evaluate<string>('document.body.innerText')),
    );
    expect(
      other.requested.every((url) => !url.includes('L1.')),
      'no token in any address',
    ).toBe(true);
  });
});
