import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { cellNumber, holds, RECORD, shownPositions, shownSeq } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

/** All rows are on screen: others are written in turns. */
const TALL = { width: 1280, height: 1600 };
/** Three decimals are shown. */
const HALF_DIGIT = 0.0005 + 1e-9;

describe('the table', () => {
  it('shows of every frame what the edge sent', async () => {
    const relay = await stage.stack.relay();
    const tap = stage.stack.tap(relay);
    stage.stack.edge(relay);
    const page = await stage.open(`${relay.url}/#/r/demo`, { preload: RECORD, viewport: TALL });

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
    expect(knees.size, 'a knee that moves').toBeGreaterThan(1);
  });

  it('fits a phone', async () => {
    const relay = await stage.demo();
    const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: { width: 390, height: 844 } });
    await until('numbers', async () => (await shownSeq(page)) !== null);
    await until('cells', holds(page, 'document.querySelector("[data-field=pos]") !== null'));
    const wide = await page.evaluate<number>('document.documentElement.scrollWidth');
    expect(wide).toBeLessThanOrEqual(390);
    const sparePx = await page.evaluate<number>(`(() => {
      const cell = document.querySelector('td[data-field=flags]');
      const { paddingLeft, paddingRight } = getComputedStyle(cell);
      const word = cell.appendChild(document.createElement('span'));
      word.textContent = 'compliant';
      const wordPx = word.getBoundingClientRect().width;
      word.remove();
      const room = cell.closest('.table-room');
      const barPx = room.offsetWidth - room.clientWidth; // on a phone it covers the page
      return cell.clientWidth + barPx - parseFloat(paddingLeft) - parseFloat(paddingRight) - wordPx;
    })()`);
    expect(sparePx, 'room for a word such as "compliant"').toBeGreaterThanOrEqual(0);
    await page.open(`${relay.url}/#/`);
    expect(await page.evaluate<number>('document.documentElement.scrollWidth')).toBeLessThanOrEqual(390);
  });

  it('tells joints with long names apart, whole in the card', async () => {
    const relay = await stage.stack.relay();
    const joints = ['left', 'right'].flatMap((side) =>
      ['hip', 'ankle', 'shoulder', 'wrist'].flatMap((part) =>
        ['pitch', 'roll', 'yaw'].map((way) => `a_humanoid_${side}_${part}_${way}_joint`),
      ),
    );
    const of = (value: number) => Object.fromEntries(joints.map((joint) => [joint, value]));
    stage.stack.fedEdge(relay, {
      ref: of(0),
      pos: of(0.1),
      vel: of(0),
      effort: of(1),
      cur: of(2),
      temp: of(30),
    });
    const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: { width: 360, height: 740 } });
    for (const [width, height] of [
      [360, 740],
      [1366, 768],
    ] as const) {
      await page.viewport({ width, height });
      await until(
        `names at ${width}`,
        holds(
          page,
          `(() => {
          const names = [...document.querySelectorAll('.joints tbody button')];
          return new Set(names.map(({ textContent }) => textContent)).size === ${joints.length}
            && names.every(({ parentElement: { scrollWidth, clientWidth } }) => scrollWidth <= clientWidth)
            && names[0].textContent.includes('…');
        })()`,
        ),
      );
      expect(await page.evaluate<number>('document.documentElement.scrollWidth')).toBeLessThanOrEqual(width);
    }
    await page.findByRole('button', joints[7]!).click();
    await until(
      'the whole name',
      holds(
        page,
        `(() => {
        const name = document.querySelector('[data-testid=joint-card] h2');
        return name?.textContent === '${joints[7]}' && name.scrollWidth <= name.clientWidth;
      })()`,
      ),
    );
  });

  it.skipIf(!FULL)(
    'tells what an update of sixty moving rows costs; under load the figure means nothing',
    async () => {
      const relay = await stage.stack.relay();
      const joints = Array.from({ length: 60 }, (_, i) => `J${i}`);
      const of = <T>(value: (i: number) => T) =>
        Object.fromEntries(joints.map((joint, i) => [joint, value(i)]));
      stage.stack.fedEdge(relay, {
        ref: of(() => 0),
        cur: of(() => 0),
        wave: { pos: of((i) => [0.5, 0.2 + i / 60]), cur: of((i) => [2, 0.3 + i / 90]) },
      });
      const page = await stage.open(`${relay.url}/#/r/demo`);
      type Sampled = { writes: number; eachMs: number[] };
      await page.evaluate(`(() => {
        const { numbers } = window.posecast;
        window.sampled = { writes: 0, eachMs: [] };
        let before = { ...numbers };
        const look = () => {
          if (numbers.writes === before.writes + 1) window.sampled.eachMs.push(numbers.scriptMs - before.scriptMs);
          window.sampled.writes = numbers.writes;
          before = { ...numbers };
          requestAnimationFrame(look);
        };
        look();
      })()`);
      const sampled = () => page.evaluate<Sampled>('window.sampled');
      await until('warm', async () => (await sampled()).writes >= 50);
      await page.evaluate('window.sampled.eachMs.length = 0');
      await until('a hundred updates', async () => (await sampled()).eachMs.length >= 100);
      const eachMs = (await sampled()).eachMs.toSorted((a, b) => a - b);
      const mean = (all: readonly number[]) => all.reduce((sum, ms) => sum + ms, 0) / all.length;
      // The page's clock has a resolution of 0.1 ms: a single update is that coarse, a mean is not.
      const undisturbed = mean(eachMs.slice(0, Math.floor(eachMs.length * 0.9)));
      console.log(
        `${mean(eachMs).toFixed(3)} ms of script for each update of 60 rows, ${undisturbed.toFixed(3)} without the slowest tenth`,
      );
      expect(await page.evaluate<number>('document.querySelectorAll(".joints tbody tr").length')).toBe(60);
    },
    240_000,
  );
});
