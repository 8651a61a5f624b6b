import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { cellNumber, liveness, RECORD, shownPositions, shownSeq } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** Three decimals are shown. */
const HALF_DIGIT = 0.0005 + 1e-9;

describe('the table', () => {
  it('shows of every frame what the edge sent', async () => {
    const relay = await stage.stack.relay();
    const tap = stage.stack.tap(relay);
    stage.stack.edge(relay);
    const page = await stage.newPage({ preload: RECORD });
    await page.open(`${relay.url}/#/r/demo`);

    const shown = await until('ten frames that the tap has too', async () => {
      const rows = [...(await shownPositions(page))].filter(([seq]) => tap.frame(seq) !== undefined);
      return rows.length >= 10 ? rows : null;
    });
    const knees = new Set<number | null>();
    for (const [seq, cells] of shown) {
      const sent = tap.frame(seq)?.values.pos ?? {};
      expect(Object.keys(cells).sort(), `joints of frame ${seq}`).toEqual(Object.keys(sent).sort());
      for (const [joint, text] of Object.entries(cells)) {
        const value = sent[joint] ?? null;
        const number = cellNumber(text);
        if (value === null) expect(number, `${joint} of frame ${seq}`).toBeNull();
        else
          expect(
            Math.abs((number ?? Number.NaN) - value),
            `${joint} of frame ${seq}: ${text}`,
          ).toBeLessThanOrEqual(HALF_DIGIT);
      }
      knees.add(cellNumber(cells.RKN ?? ''));
    }
    expect(shown.some(([seq]) => Number(seq) > 0)).toBe(true);
    console.log(`compared ${shown.length} frames, right knee ${[...knees].join(', ')}`);
  });

  it('shows a robot that moves', async () => {
    const relay = await stage.stack.relay();
    stage.stack.edge(relay);
    const page = await stage.newPage({ preload: RECORD });
    await page.open(`${relay.url}/#/r/demo`);
    await until(
      'a knee that moves',
      async () => {
        const knees = [...(await shownPositions(page)).values()].map((cells) => cells.RKN);
        return new Set(knees).size >= 5;
      },
      60_000,
    );
  });

  it('is where the list leads', async () => {
    const relay = await stage.stack.relay();
    stage.stack.edge(relay);
    const page = await stage.newPage();
    await page.open(`${relay.url}/`);
    const card = page.findByRole('link', /demo/i);
    await until('a card', async () => (await card.count()) > 0);
    expect(
      page.requested.filter((url) => /scene/i.test(url)),
      'no 3D before a robot is chosen',
    ).toEqual([]);
    await card.click();
    await until('LIVE', async () => ['LIVE', 'HOLDING'].includes(await liveness(page)));
  });

  it('fits a phone', async () => {
    const relay = await stage.stack.relay();
    stage.stack.edge(relay);
    const page = await stage.newPage({ viewport: { width: 390, height: 844 } });
    await page.open(`${relay.url}/#/r/demo`);
    await until('numbers', async () => (await shownSeq(page)) !== null);
    await until('cells', () => page.evaluate<boolean>('document.querySelector("[data-field=pos]") !== null'));
    const wide = await page.evaluate<number>('document.documentElement.scrollWidth');
    expect(wide).toBeLessThanOrEqual(390);
    await page.open(`${relay.url}/#/`);
    expect(await page.evaluate<number>('document.documentElement.scrollWidth')).toBeLessThanOrEqual(390);
  });
});
