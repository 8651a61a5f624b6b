import { setTimeout as pause } from 'node:timers/promises';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { chipText, holds, is, liveness, RECORD, testId, whole } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';
import { ClockRobot, shown, stepToFrame, WITNESS } from './truth.ts';

const stage = setStage();

const PHONE = { width: 390, height: 844 };
const LAPTOP = { width: 1366, height: 768 };
/** Time from the joint to the relay, on a busy machine. */
const NEAR_MS = 1000;

/** Waits until at least this many seconds of past are available. */
async function rewindable(page: Page, seconds: number): Promise<void> {
  await until(
    `${seconds} s of past`,
    holds(
      page,
      `(() => {
          const track = ${testId('track')}; return track !== null && track.ariaValueMax - track.ariaValueMin >= ${seconds}; })()`,
    ),
  );
}

/** Taps on the time line at this fraction of its length. */
async function tapAt(page: Page, part: number): Promise<void> {
  const at = await page.evaluate<{ x: number; y: number }>(`(() => {
    const { left, top, width, height } = ${testId('track')}.getBoundingClientRect();
    return { x: left + width * ${part}, y: top + height / 2 };
  })()`);
  await page.click(at);
}

it.each(FULL ? [LAPTOP, PHONE] : [LAPTOP])(
  'what was is shown as what was, at $width px',
  async (viewport) => {
    const relay = await stage.stack.relay({ past: 'memory:' });
    const robot = new ClockRobot(stage.stack, relay);
    const page = await stage.open(`${relay.url}/#/r/demo`, { preload: `${RECORD};${WITNESS}`, viewport });
    await until('LIVE', is(page, 'LIVE'));
    await until('a body', () => whole(page));
    await rewindable(page, 12);
    await page.screenshot(`time-line-${viewport.width}.png`);

    await tapAt(page, 0.4);
    await until('PAST', is(page, 'PAST'));
    expect(await chipText(page)).toMatch(/^PAST\d\d:\d\d:\d\d/);
    expect(await page.evaluate<string>('document.title')).toMatch(/^PAST/);
    expect(await page.evaluate<string>(`${testId('stage-note')}.textContent`)).toMatch(/\d\d:\d\d:\d\d/);
    const playing = await shown(page);
    await until('it plays', async () => (await shown(page)).seq > playing.seq + 10);
    await page.press('Space');
    const rests = async () => {
      const [one, two] = [await shown(page), await shown(page)];
      return one.momentMs === two.momentMs && one.offMs < NEAR_MS;
    };
    await until('it rests, at the pose of its moment', rests);
    await page.screenshot(`past-${viewport.width}.png`);

    expect((await stepToFrame(page)).offMs).toBeLessThan(NEAR_MS);

    // a link to the moment
    const link = await until('a moment in the address', async () => {
      const href = await page.evaluate<string>('location.href');
      const named = Date.parse(/[?&]t=([\d:.TZ-]+)/.exec(href)?.[1] ?? '');
      return named === Math.ceil((await shown(page)).momentMs!) ? href : null;
    });
    const other = await stage.newPage({ viewport });
    await other.open(link!);
    await until('PAST', is(other, 'PAST'));
    await until('a body', () => whole(other));
    await until('the same frame', async () => {
      const [here, there] = [await shown(page), await shown(other)];
      if (here.seq !== there.seq) throw new Error(JSON.stringify([here, there, link]));
      return true;
    });
    await other.close();

    // live, past and live again
    await page.findByTestId('to-live').click();
    await until('LIVE', is(page, 'LIVE'));
    expect(await page.evaluate<string>('document.title')).not.toMatch(/PAST/);
    await until(
      'no moment in the address',
      async () => !/[?&]t=/.test(await page.evaluate<string>('location.href')),
    );
    await tapAt(page, 0.3);
    await until('PAST', is(page, 'PAST'));
    expect(await robot.lies(page)).toEqual([]);

    // the relay is gone: the page's own data is still shown, and labelled as such
    const segments = () => page.requested.filter((url) => /\/past\/public\/[0-9a-f]{16}\//.test(url)).length;
    await until('the seconds before are here, for the plots', async () => {
      const before = segments();
      await pause(1500);
      return segments() === before;
    });
    await relay.process.kill();
    await tapAt(page, 0.2);
    await until('a pose near its moment', async () => (await shown(page)).offMs < 1000);
    expect(await liveness(page)).toBe('PAST');
    await page.findByTestId('to-live').click();
    await until('STALE', is(page, 'STALE'));
    expect(await robot.lies(page)).toEqual([]);
    page.forgive(/ERR_|WebSocket|Failed to load|NetworkError|CORS|access control/i);
  },
  240_000,
);

it('a moment has its link while presented, and one that can’t be shown is named', async () => {
  const relay = await stage.stack.relay({ past: 'memory:' });
  new ClockRobot(stage.stack, relay);
  const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: LAPTOP });
  await until('LIVE', is(page, 'LIVE'));
  await until('a body', () => whole(page));
  await rewindable(page, 12);
  const text = (id: string) => page.evaluate<string>(`${testId(id)}?.textContent ?? ''`);
  const address = () => page.evaluate<string>('location.href');

  await tapAt(page, 0.4);
  await until('PAST', is(page, 'PAST'));
  await until('the address names a moment that plays', async () => /[?&]t=/.test(await address()));
  await page.press('Space');
  for (const [width, height] of [
    [844, 390],
    [390, 844],
  ] as const) {
    await page.viewport({ width, height });
    await until(
      `the chip's clock and the frame at ${width} px, once`,
      holds(
        page,
        `(() => {
        const chip = ${testId('liveness')};
        const { left, right, top, height } = chip.getBoundingClientRect();
        const on = document.elementFromPoint((left + right) / 2, top + height / 2);
        const frame = getComputedStyle(document.querySelector('.split-body'), '::after').borderTopWidth;
        return innerWidth === ${width} && /^PAST\\d\\d:\\d\\d:\\d\\d/.test(chip.textContent) && chip.contains(on)
          && frame === '2px' && !${testId('stage-note')}.checkVisibility();
      })()`,
      ),
    );
    await page.screenshot(`past-banner-${width}.png`);
  }
  await page.viewport(LAPTOP);
  await page.press('p');
  await until('its moment in the presented address', async () => {
    const t = /[?&](t=[\d:.TZ-]+)/.exec(await address())?.[1];
    return t !== undefined && (await text('present-address')).includes(t);
  });
  await page.screenshot('past-presented.png');

  const link = (t: string) => `${relay.url}/#/r/demo?t=${t}`;
  const old = /[123] Jan (2026 )?.*is no longer kept; this is the oldest moment, \d\d:\d\d:\d\d/;
  await page.open(link('2026-01-02T12:00:00.000Z'));
  await page.viewport({ width: 390, height: 844 });
  await until(
    'the banner names it, on a phone too',
    async () =>
      old.test(await text('stage-note')) && holds(page, `${testId('stage-note')}.checkVisibility()`)(),
  );
  expect(await text('past-note')).toMatch(old);
  await page.open('about:blank');
  await page.open(link('2199-01-02T12:00:00.000Z'));
  await until('it has not come', async () => /2199.*in the future/.test(await text('past-note')));
  await until('LIVE', is(page, 'LIVE'));
  await page.open('about:blank');
  await page.open(link('hello'));
  await until('no moment', async () => /moment in this link can’t be read/.test(await text('past-note')));
  await until('LIVE', is(page, 'LIVE'));
}, 240_000);

it('a link to a moment says so where there is no past, and shows what is live', async () => {
  const relay = await stage.stack.demo({ past: '0' });
  const page = await stage.open(`${relay.url}/#/r/demo?t=2026-11-22T14:02:07.250Z`, { viewport: PHONE });
  await until('it is said', async () =>
    /moment in this link/.test(
      (await page.evaluate<string>(`${testId('past-note')}?.textContent ?? ''`)) ?? '',
    ),
  );
  await until('LIVE', is(page, 'LIVE'));
  await page.close();
});
