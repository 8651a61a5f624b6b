import { describe, it } from 'vitest';
import { CLOUD } from './cloud.ts';
import { engineName } from './driver/engines.ts';
import { until } from './driver/until.ts';
import { hasSkin, is, RECORD, shownPositions, shownSeq } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

describe('a deployed cloud', () => {
  it('shows its robot over TLS: in the list, in numbers, in the body', async (context) => {
    if (CLOUD === null) return context.skip('make compose-test starts one');
    if (engineName() !== 'chromium')
      context.skip('only Chromium takes a certificate of an unknown authority');
    const page = await stage.open(`${CLOUD.url}/`, { preload: RECORD });
    await page.findByRole('link', /demo/i).click();
    await until('LIVE', is(page, 'LIVE', 'HOLDING'));
    await until('a body', () => hasSkin(page));
    const first = (await shownSeq(page)) ?? -1;
    await until('newer frames', async () => ((await shownSeq(page)) ?? -1) > first + 30);
    await until('numbers that move', async () => {
      const rows = [...(await shownPositions(page)).values()];
      return new Set(rows.map((cells) => JSON.stringify(cells))).size > 5;
    });
  });
});
