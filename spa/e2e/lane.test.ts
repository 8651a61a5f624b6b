import { describe, expect, it } from 'vitest';
import { freePort } from './driver/free_port.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { chips, chipText, is, RECORD, whole } from './robot_page.ts';
import type { Relay } from './stack.ts';
import { FULL, setStage } from './stage.ts';
import { ClockRobot, WITNESS } from './truth.ts';

const stage = setStage();

/** A part takes about four seconds, unless its robot's state changes. */
const BEHIND_MS = { least: 1000, most: 9000 };
const FIRST_PART_MS = 7000;
/** Time from the joint to the screen, on a busy machine. */
const NEAR_MS = 1500;

/** Few pixels, with the table beside them. */
const SMALL = { width: 1100, height: 420 };
/** Two pages that draw in 3D in software would be too much for one machine. */
const LIGHT = `try { localStorage.setItem('posecast.settings', '{"body":"light"}') } catch {}`;

/** Runs before the page's own scripts: records when each frame is first shown, and over which transport it arrived. */
const SHOWN = `(() => {
  const shown = (window.shownFrames = []);
  const look = () => {
    const { twin, link } = window.posecast ?? {};
    const last = shown.at(-1);
    if (twin?.seq != null && (last === undefined || last.seq !== twin.seq))
      shown.push({ seq: twin.seq, tS: twin.t_s, atMs: Date.now(), by: link.carrier, behindMs: link.behind_ms });
  };
  setInterval(look, 10); // not per picture, because a busy machine draws few
})()`;

interface Shown {
  readonly seq: number;
  readonly tS: number;
  readonly atMs: number;
  readonly by: string;
  readonly behindMs: number | null;
}

const shownFrames = (page: Page) => page.evaluate<Shown[]>('window.shownFrames');
const carrier = (page: Page) => page.evaluate<string | null>('window.posecast?.link?.carrier ?? null');
const behindMs = (page: Page) => page.evaluate<number | null>('window.posecast?.link?.behind_ms ?? null');
const title = (page: Page) => page.evaluate<string>('document.title');

async function watching(relay: { url: string }, by: 'websocket' | 'segments', search = ''): Promise<Page> {
  const page = await stage.open(`${relay.url}/${search}#/r/demo`, {
    viewport: SMALL,
    preload: `${LIGHT};${RECORD};${WITNESS};${SHOWN}`,
  });
  await until(`LIVE by ${by}`, async () => (await is(page, 'LIVE')()) && (await carrier(page)) === by);
  await until('a body', () => whole(page));
  return page;
}

/** Waits until the page has shown this many more frames. */
async function goesOn(page: Page, frames = 60): Promise<void> {
  const before = (await shownFrames(page)).length;
  await until(`${frames} frames more`, async () => (await shownFrames(page)).length >= before + frames);
}

/** A place may be free for a long time before a page retries; coming back online triggers a retry. */
const nudge = (page: Page) => page.evaluate(`window.dispatchEvent(new Event('online'))`);

/** The frame numbers on this page increase, each occurring once, whatever the transport. */
async function expectRising(page: Page): Promise<void> {
  const shown = await shownFrames(page);
  const fallen = shown.filter((frame, i) => i > 0 && frame.seq <= shown[i - 1]!.seq);
  expect(fallen, 'a frame that is shown again, or one from before').toEqual([]);
}

/** The state words of this page since it was first LIVE. */
async function wordsSince(page: Page): Promise<string[]> {
  const said = (await chips(page)).map(({ state }) => state);
  return said.slice(said.indexOf('LIVE'));
}

it('a relay that is full refuses nobody: who comes then sees the same, behind, and takes a place when one is free', async () => {
  const relay = await stage.stack.relay({ past: 'memory:', maxViewers: 1 });
  const robot = new ClockRobot(stage.stack, relay);
  const first = await watching(relay, 'websocket');
  expect(await chipText(first)).not.toMatch(/behind/);
  const second = await watching(relay, 'segments');
  await until('how far behind', async () => / s behind$/.test(await chipText(second)));
  expect(await chipText(second)).toMatch(/^LIVE(\d+ Hz)?\d s behind$/);
  expect(await title(second)).toMatch(/^LIVE · \d s behind · /);
  // for the first part, only an upper bound of its delay is known
  await until('the second part', async () => {
    const shown = await shownFrames(second);
    return (shown.at(-1)?.atMs ?? 0) - shown[0]!.atMs > FIRST_PART_MS;
  });
  await goesOn(second, 100);

  // each frame is the robot's own, only earlier; a page skips frames, so compare with two surrounding ones of the other page
  const ofFirst = await shownFrames(first);
  const both = (await shownFrames(second)).slice(-100).flatMap((frame) => {
    const i = ofFirst.findIndex(({ seq }) => seq >= frame.seq);
    const [before, after] = [ofFirst[i - 1], ofFirst[i]];
    return before === undefined || after === undefined ? [] : [{ before, frame, after }];
  });
  expect(both.length).toBeGreaterThan(50);
  const isBetween = ({ before, frame, after }: (typeof both)[number]) =>
    before.tS < frame.tS && frame.tS <= after.tS && (frame.seq === after.seq) === (frame.tS === after.tS);
  expect(both.filter((each) => !isBetween(each))).toEqual([]);
  const off = both.filter(({ before, frame, after }) => {
    const toldMs = frame.behindMs ?? 0;
    const isTold = toldMs > BEHIND_MS.least && toldMs < BEHIND_MS.most;
    return (
      !isTold || frame.atMs - toldMs < before.atMs - NEAR_MS || frame.atMs - toldMs > after.atMs + NEAR_MS
    );
  });
  expect(off.length, JSON.stringify(off.slice(0, 3))).toBeLessThan(both.length / 20);
  expect((await chips(second)).map(({ text }) => text).join(' ')).not.toMatch(/full/);

  // why
  await second.findByTestId('liveness').click();
  const explained = () => second.findByTestId('liveness-explained').text();
  await until('why', async () => /All places are taken/.test(await explained()));
  await second.press('Escape');

  // the first viewer leaves
  await first.close();
  const isPlaced = async () => (await carrier(second)) === 'websocket';
  await until('a place', async () => {
    await nudge(second);
    return until('a place', isPlaced, 3000).catch(() => false);
  });
  await until('no longer behind', async () => !/behind/.test(await chipText(second)));
  expect(await behindMs(second)).toBeNull();
  await goesOn(second);
  expect(await title(second)).not.toMatch(/behind/);
  expect(await wordsSince(second), 'LIVE all the while').toEqual(['LIVE']);

  await expectRising(second);
  expect(await robot.lies(second)).toEqual([]);
  if (!FULL) return;

  // and returns
  const again = await watching(relay, 'segments');
  await goesOn(again);
  await expectRising(again);
  expect(await robot.lies(again)).toEqual([]);
});

const KNEE = {
  flags: { RKN: ['homed', 'enabled'] },
  wave: { pos: { RKN: [0.4, 0.5] }, ref: { RKN: [0.4, 0.5] } },
};
const JAMMED = { ...KNEE, flags: { RKN: ['homed', 'enabled', 'jam'] } };

/** What the page reports about faults: the line (without the duration), and the number of starts and ends in the list. */
const saidOfFaults = (page: Page) =>
  page.evaluate<{ line: string; times: string | null; listed: string[] }>(`(() => {
    const line = document.querySelector('[data-testid=fault-line]')?.textContent ?? '';
    const items = [...document.querySelectorAll('[data-testid=alarms] > li')];
    return {
      line: line.replace(/ended .*? ago/, 'ended'),
      times: /\\d+\\w\\w time/.exec(line)?.[0] ?? null,
      listed: items.map((item) => item.dataset.level + ' ' + item.dataset.state),
    };
  })()`);

it.skipIf(!FULL)(
  'who comes to a full relay is told the faults of before, as who has a place, and keeps them with a place',
  async () => {
    const relay = await stage.stack.relay({ past: 'memory:', maxViewers: 1 });
    const { source } = stage.stack.fedEdge(relay, KNEE, { profile: 'demo' });
    const open = async (by: 'websocket' | 'segments') => {
      const page = await stage.open(`${relay.url}/#/r/demo`, {
        viewport: { width: 1280, height: 800 },
        preload: `${LIGHT};${RECORD};${SHOWN}`,
      });
      await until(`by ${by}`, async () => (await carrier(page)) === by);
      return page;
    };
    const first = await open('websocket');
    await until('LIVE', is(first, 'LIVE'));
    for (const times of [null, '2nd time', '3rd time']) {
      source.write(JSON.stringify({ ...JAMMED, once: true }));
      await until(`${times}`, async () => {
        const said = await saidOfFaults(first);
        return /^Earlier: /.test(said.line) && said.times === times;
      });
      await goesOn(first, 30); // two faults within a second may count as one
    }
    await first.findByRole('tab', 'Alarms').click();
    const told = await saidOfFaults(first);
    expect(told.listed).toHaveLength(6);

    const second = await open('segments');
    await second.findByRole('tab', 'Alarms').click();
    const agrees = async (page: Page) => JSON.stringify(await saidOfFaults(page)) === JSON.stringify(told);
    await until('the same in the lane', () => agrees(second)).catch(async () =>
      expect(await saidOfFaults(second)).toEqual(told),
    );
    await first.close();
    await until('a place', async () => {
      await nudge(second);
      return until('a place', async () => (await carrier(second)) === 'websocket', 3000).catch(() => false);
    });
    await goesOn(second);
    expect(await saidOfFaults(second), 'nothing twice').toEqual(told);
  },
);

describe.skipIf(!FULL)('in the lane', () => {
  /** A relay whose only place is taken, and a page in the lane. */
  async function inLane(relay: Relay): Promise<{ robot: ClockRobot; first: Page; page: Page }> {
    const robot = new ClockRobot(stage.stack, relay);
    const first = await watching(relay, 'websocket');
    return { robot, first, page: await watching(relay, 'segments') };
  }

  it('a robot that pauses, stands, and goes on is what it was, so much later', async () => {
    const relay = await stage.stack.relay({ past: 'memory:', maxViewers: 1 });
    const { robot, page } = await inLane(relay);
    await goesOn(page);
    robot.source.signal('SIGSTOP');
    await until('STALE', is(page, 'STALE'));
    await until('as the robot is', async () => /robot silent/.test(await chipText(page)));
    expect(await chipText(page)).toMatch(/^STALE\d+(\.\d)? s: robot silent\d s behind$/);
    robot.source.signal('SIGCONT');
    await until('LIVE again', is(page, 'LIVE'));
    robot.stand();
    await until('HOLDING', is(page, 'HOLDING'));
    expect(await chipText(page)).toMatch(/^HOLDING\d+(\.\d)? s\d s behind$/);
    robot.go();
    await until('LIVE again', is(page, 'LIVE'));
    await goesOn(page);
    await expectRising(page);
    expect(await robot.lies(page)).toEqual([]);
  });

  it('a relay that is replaced is found again within seconds', async () => {
    const [httpPort, zenohPort] = [await freePort(), await freePort()];
    const options = { past: 'memory:', maxViewers: 1, httpPort, zenohPort };
    const relay = await stage.stack.relay(options);
    const { robot, first, page } = await inLane(relay);
    for (const one of [first, page])
      one.forgive(/WebSocket|Failed to load resource|NetworkError|ERR_|status of 50|CORS|Could not connect/);
    await goesOn(page);
    await relay.process.stop();
    await until('STALE', is(page, 'STALE'));
    await stage.stack.relay(options);
    await until('LIVE again', is(page, 'LIVE'));
    await goesOn(page);
    expect(await robot.lies(page)).toEqual([]);
  });

  it('looks back, and Live leads back to the lane', async () => {
    const relay = await stage.stack.relay({ past: 'memory:', maxViewers: 1 });
    const { robot, page } = await inLane(relay);
    await goesOn(page, 300);
    await page.press('j');
    await until('PAST', is(page, 'PAST'));
    expect(await chipText(page)).not.toMatch(/behind/);
    await page.screenshot(`lane-past-${stage.browser.engine}.png`);
    await page.press('e');
    await until('LIVE', is(page, 'LIVE'));
    await until('behind', async () => / s behind$/.test(await chipText(page)));
    expect(await carrier(page)).toBe('segments');
    await goesOn(page);
    expect(await robot.lies(page)).toEqual([]);
  });
});
