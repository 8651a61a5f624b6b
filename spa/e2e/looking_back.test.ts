import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { FaultyLink } from './proxy.ts';
import { holds, is, liveness, whole } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';

/** The page of a robot with half an hour of past, for the figures in the docs; by default, some seconds are recorded here. */
const AT = process.env.POSECAST_PAST_AT;
const TAPS = AT === undefined ? 3 : 20;
const ROUND_TRIP_MS = 50;
const DRAG_MS = 4000;

/** Without WebGL, for the light view: with 3D in software, pictures are too rare to measure anything else. */
const stage = setStage({ webgl: false });

interface Drag {
  readonly poses: number;
  readonly moves: number;
  readonly seconds: number;
}

const track = `document.querySelector('[data-testid="track"]')`;

/** Simulates a pointer in the page: `part` of the line, from 0 to 1. */
const HAND = `(() => {
  const send = (type, part) => {
    const track = ${track};
    const { left, top, width, height } = track.getBoundingClientRect();
    const at = { clientX: left + width * part, clientY: top + height / 2, pointerId: 1, isPrimary: true };
    track.dispatchEvent(new PointerEvent(type, { bubbles: true, cancelable: true, button: 0, buttons: type === 'pointerup' ? 0 : 1, ...at }));
  };
  const turn = () => new Promise((resolve) => setTimeout(resolve, 2));
  const past = () => { const { twin } = window.posecast; return twin.moment_ms === null ? null : twin.moment_ms + ' ' + twin.seq; };
  window.hand = {
    /** Taps; the time until a pose from the past is in the twin, ms. */
    async tap(part) {
      const before = past();
      const began = performance.now();
      send('pointerdown', part);
      send('pointerup', part);
      while (past() === before || past() === null) await turn();
      return performance.now() - began;
    },
    /** Drags across the line, one move per picture; the number of new poses in the twin. */
    async drag(from, to) {
      let poses = 0, moves = 0, last = past();
      const see = () => { const now = past(); if (now !== null && now !== last) poses += 1; last = now; };
      const began = performance.now();
      send('pointerdown', from);
      while (performance.now() - began < ${DRAG_MS}) {
        send('pointermove', from + (to - from) * (performance.now() - began) / ${DRAG_MS});
        moves += 1;
        await new Promise(requestAnimationFrame);
        see();
      }
      send('pointerup', to);
      return { poses, moves, seconds: (performance.now() - began) / 1000 };
    },
  };
})()`;

const heapMb = (page: Page) => page.evaluate<number>('(performance.memory?.usedJSHeapSize ?? NaN) / 1e6');
const asked = (page: Page) => page.requested.filter((url) => /\/past\b/.test(url)).length;
const quantile = (values: readonly number[], part: number) =>
  values.toSorted((a, b) => a - b)[Math.ceil(values.length * part) - 1]!;

/** Waits until enough past is available. */
async function rewindable(page: Page): Promise<void> {
  const seconds = AT === undefined ? 12 : 60;
  const span = `(() => { const track = ${track}; return track !== null && track.ariaValueMax - track.ariaValueMin >= ${seconds}; })()`;
  await until('a past', holds(page, span));
}

it.skipIf(!FULL)(
  'how soon the past is there, and how it follows the finger, is told',
  async () => {
    const relay = await stage.stack.relay({ past: 'memory:' });
    if (AT === undefined) stage.stack.edge(relay);
    const url = new URL(AT ?? `${relay.url}/#/r/demo`);
    const link = await FaultyLink.open(Number(url.port));
    const visit = async (): Promise<Page> => {
      const page = await stage.open(`${link.url}/${url.hash}`, { viewport: { width: 1366, height: 768 } });
      await until('LIVE', is(page, 'LIVE'));
      await until('a body', () => whole(page));
      await rewindable(page);
      await page.evaluate(HAND);
      return page;
    };
    try {
      link.fault({ delayMs: ROUND_TRIP_MS / 2 });
      const first: number[] = [];
      for (let n = 0; n < TAPS; n++) {
        const page = await visit();
        first.push(await page.evaluate<number>(`hand.tap(${(0.9 * (n + 0.5)) / TAPS})`));
        await page.close();
      }
      const page = await visit();
      const minute: number[] = [];
      for (let n = 0; n < TAPS; n++) {
        minute.push(await page.evaluate<number>(`hand.tap(${AT === undefined ? 0.8 : 0.985})`));
        await page.findByTestId('to-live').click();
        await until('LIVE', is(page, 'LIVE'));
      }
      const [before, heap] = [asked(page), await heapMb(page)];
      const drags: Drag[] = [];
      drags.push(await page.evaluate<Drag>('hand.drag(0.02, 0.98)'));
      const needed = asked(page) - before;
      for (const way of ['0.98, 0.02', '0.02, 0.98', '0.98, 0.02'])
        drags.push(await page.evaluate<Drag>(`hand.drag(${way})`));
      const rates = drags.map(({ poses, seconds }) => poses / seconds);
      console.log(
        [
          `first past pose at ${ROUND_TRIP_MS} ms: p50 ${quantile(first, 0.5).toFixed(0)}, p95 ${quantile(first, 0.95).toFixed(0)} ms`,
          `within the last minute: p50 ${quantile(minute, 0.5).toFixed(0)}, p95 ${quantile(minute, 0.95).toFixed(0)}, a page's first ${minute[0]!.toFixed(0)} ms`,
          `poses a second: ${rates.map((rate) => rate.toFixed(1)).join(', ')} (moves ${drags.map(({ moves, seconds }) => (moves / seconds).toFixed(1)).join(', ')})`,
          `requests of the first drag: ${needed}; heap ${heap.toFixed(1)} to ${(await heapMb(page)).toFixed(1)} MB`,
        ].join('\n'),
      );
      expect(needed).toBeLessThanOrEqual(12);
      expect(await liveness(page)).toBe('PAST');
    } finally {
      await link.close();
    }
  },
  600_000,
);
