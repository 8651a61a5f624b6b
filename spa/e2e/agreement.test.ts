import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { FaultyLink } from './proxy.ts';
import { holds, whole } from './robot_page.ts';
import { setStage } from './stage.ts';
import { ClockRobot } from './truth.ts';

const stage = setStage();

/** The content of one picture: the chip's state and text, the banner's state and text, and the target and actual grey of the body
 *  (0…1); null without a banner or body. `number`: which picture it was. */
interface Seen {
  readonly chip: string;
  readonly says: string;
  readonly banner: string | null;
  readonly why: string;
  readonly old: boolean | null;
  readonly grey: number | null;
  readonly atMs: number;
  readonly number: number;
}

/** Runs before the page's own scripts: after each picture, records what it showed, if that changed. */
const LOOKING = `(() => {
  const seen = (window.seen = []);
  let before = '', number = 0;
  const note = () => {
    number += 1;
    const chip = document.querySelector('[data-testid="liveness"]');
    if (chip === null) return;
    const banner = document.querySelector('[data-testid="stage-note"]');
    const body = window.posecast?.scene?.robots?.[0];
    const shown = body?.figure ? { old: body.isOld, grey: body.grey } : { old: null, grey: null };
    const all = {
      chip: chip.dataset.state,
      says: chip.textContent.replace(/[\\d.,]+/g, '#'),
      banner: banner?.dataset.word ?? null,
      why: (banner?.textContent ?? '').replace(/[\\d.,]+/g, '#'),
      ...shown,
    };
    const text = JSON.stringify(all);
    if (text === before) return;
    before = text;
    seen.push({ ...all, atMs: performance.now(), number });
  };
  const look = () => {
    setTimeout(note); // after everything that this picture changes has changed
    requestAnimationFrame(look);
  };
  look();
})()`;

/** Whether the newest picture shows this state word. */
const is = (page: Page, word: string) => () =>
  page.evaluate<boolean>(`window.seen?.at(-1)?.chip === '${word}'`);
const isClaim = (word: string) => word === 'LIVE' || word === 'HOLDING';
const REASONS = [
  [/robot silent/, /robot silent/],
  [/no such robot/, /No robot here has this name/],
  [/relay restarting/, /relay is restarting/],
  [/relay full/, /relay is full/],
] as const;

/** After this time and so many pictures the fading has begun. A busy machine may have time for no picture. */
const FADED_MS = 1000;
const FADED_PICTURES = 5;

/** Lists how chip, banner and body disagreed. */
async function disagreements(page: Page): Promise<string[]> {
  const seen = await page.evaluate<Seen[]>('window.seen');
  const found = new Set<string>();
  let since = { atMs: 0, number: 0 };
  seen.forEach((now, i) => {
    const { chip, says, banner, why, old, grey } = now;
    const where = `${says} | ${why} | ${old} ${grey}`;
    if (i === 0 || isClaim(chip) !== isClaim(seen[i - 1]!.chip)) since = now;
    if ((chip === 'STALE' || chip === 'OFFLINE') !== (banner !== null)) found.add(`banner or none: ${where}`);
    if (banner !== null && banner !== chip) found.add(`banner says ${banner}: ${where}`);
    for (const [short, long] of REASONS)
      if (banner !== null && short.test(says) !== long.test(why)) found.add(`another reason: ${where}`);
    if (old !== null && old === isClaim(chip)) found.add(`body: ${where}`);
    const until = seen[i + 1] ?? now;
    const lasts = until.atMs - since.atMs > FADED_MS && until.number - since.number > FADED_PICTURES;
    if (grey !== null && lasts && grey > 0 === isClaim(chip)) found.add(`colour: ${where}`);
  });
  return [...found];
}

it('chip, banner and body agree in every picture, whatever happens to the robot, its edge, the relay and the page', async () => {
  const relay = await stage.stack.relay();
  const robot = new ClockRobot(stage.stack, relay);
  const link = await FaultyLink.open(relay.port);
  try {
    const page = await stage.newPage({ preload: LOOKING, viewport: { width: 390, height: 700 } });
    page.forgive(/WebSocket|ERR_|Failed to load|NetworkError|access control|Could not connect/i);
    await page.open(`${link.url}/#/r/demo`);
    await until('LIVE', is(page, 'LIVE'));
    await until('a body', () => whole(page));
    robot.stand();
    await until('HOLDING', is(page, 'HOLDING'));
    robot.go();
    await until('LIVE', is(page, 'LIVE'));
    for (const heldUpMs of [700, 3000])
      for (let times = 0; times < 2; times += 1) {
        // a separate task, as on a busy page
        await page.evaluate(
          `void setTimeout(() => { const end = performance.now() + ${heldUpMs}; while (performance.now() < end); window.heldUp = (window.heldUp ?? 0) + 1; })`,
        );
        await until('LIVE after being held up', is(page, 'LIVE'));
      }
    await until('held up four times', holds(page, 'window.heldUp === 4'));
    robot.source.signal('SIGSTOP');
    await until('STALE', is(page, 'STALE'));
    const cutPx = `(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth)(document.querySelector('.chip-detail'))`;
    expect(await page.evaluate<number>(cutPx), 'of its age, on a phone').toBe(0);
    robot.source.signal('SIGCONT');
    await until('LIVE again', is(page, 'LIVE'));
    link.cut(true);
    await until('no connection', is(page, 'STALE'));
    link.heal();
    await until('LIVE again', is(page, 'LIVE'));
    await robot.edge.kill();
    await until('OFFLINE', is(page, 'OFFLINE'));
    expect(await disagreements(page)).toEqual([]);
  } finally {
    await link.close();
  }
}, 300_000);

it('a robot that is refused is called the same by chip and banner, and nothing is called old', async () => {
  const robots = path.join(stage.stack.folder(), 'robots.toml');
  writeFileSync(robots, '[robots.demo.anyone]\nhz = 30\n[robots.hidden.link]\n', { mode: 0o600 });
  const relay = await stage.stack.relay({ robots });
  const page = await stage.newPage({ preload: LOOKING, viewport: { width: 390, height: 700 } });
  page.forgive(/WebSocket|404|4\d\d/);
  await page.open(`${relay.url}/#/r/hidden`);
  const chip = page.findByTestId('liveness');
  await until('refused', async () => /no such robot/.test(await chip.text()));
  expect(await chip.text()).not.toMatch(/STALE|no connection/);
  expect(await page.findByTestId('stage-note').text()).toMatch(/No robot here has this name/);
  expect(await disagreements(page)).toEqual([]);
  await chip.click();
  await until('why', async () => (await page.findByTestId('liveness-explained').text()) !== '');
  expect(await page.findByTestId('liveness-explained').text()).toMatch(/No robot here has this name/);
}, 120_000);
