import { setTimeout as pause } from 'node:timers/promises';
import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { FaultyLink } from './proxy.ts';
import { chips, is, RECORD, whole } from './robot_page.ts';
import type { Relay } from './stack.ts';
import { FULL, setStage } from './stage.ts';
import { ageOfLive, ClockRobot, WITNESS } from './truth.ts';

const stage = setStage();

/** Longer than a page may call an old pose live, and shorter than it takes to notice a dead socket. */
const OUTAGE_MS = 2600;

async function watched(url: string): Promise<Page> {
  const page = await stage.open(`${url}/#/r/demo`, { preload: `${RECORD};${WITNESS}` });
  await until('LIVE', is(page, 'LIVE'));
  await until('a body', () => whole(page));
  return page;
}

/** Lets the page show its current content for longer than any claim is valid. */
async function goesOn(page: Page): Promise<void> {
  const seen = () => page.evaluate<number>('window.witnessed.length');
  const before = await seen();
  await pause(OUTAGE_MS);
  await until('pictures go on', async () => (await seen()) > before);
}

it('what is claimed of a robot that moves, stands and moves is so', async () => {
  const relay = await stage.stack.relay();
  const robot = new ClockRobot(stage.stack, relay);
  const page = await watched(relay.url);
  await goesOn(page);
  robot.stand();
  await until('HOLDING', is(page, 'HOLDING'));
  await goesOn(page);
  robot.go();
  await until('LIVE', is(page, 'LIVE'));
  await goesOn(page);
  expect(await robot.lies(page)).toEqual([]);
  const { p50, p99 } = await ageOfLive(page);
  console.log(`while LIVE the body's pose is ${p50} ms old, 99 % of the pictures at most ${p99} ms`);
});

describe('after an outage no pose from before it is claimed', () => {
  /** Breaks something while a robot is watched, repairs it, and checks the page's claims. */
  async function outage(
    link: { url: string },
    relay: Relay,
    breaks: (robot: ClockRobot, page: Page) => Promise<() => Promise<void> | void>,
    stands = false,
  ): Promise<void> {
    const robot = new ClockRobot(stage.stack, relay);
    const page = await watched(link.url);
    if (stands) {
      robot.stand();
      await until('HOLDING', is(page, 'HOLDING'));
    }
    const mend = await breaks(robot, page);
    if (stands) robot.go();
    await pause(OUTAGE_MS);
    await mend();
    await until('LIVE again', is(page, 'LIVE'));
    await goesOn(page);
    expect(await robot.lies(page)).toEqual([]);
    if (stands) {
      const said = (await chips(page)).map(({ state }) => state);
      expect(said.lastIndexOf('HOLDING')).toBe(said.indexOf('HOLDING'));
    }
  }

  it.each([[', which it began while it stood', true], ...(FULL ? [['', false] as const] : [])] as const)(
    'of its network, which then brings all that was on its way%s',
    async (_, stands) => {
      const relay = await stage.stack.relay();
      const link = await FaultyLink.open(relay.port);
      try {
        await outage(
          link,
          relay,
          async () => {
            link.fault({ frozen: true });
            return () => link.heal();
          },
          stands,
        );
      } finally {
        await link.close();
      }
    },
  );

  it.skipIf(!FULL)('of its network, where events carry the stream', async () => {
    const relay = await stage.stack.relay();
    const link = await FaultyLink.open(relay.port);
    link.fault({ stripUpgrade: true });
    try {
      await outage(link, relay, async (_, page) => {
        page.forgive(/WebSocket|status of 40\d/);
        link.fault({ stripUpgrade: true, frozen: true });
        return () => link.fault({ stripUpgrade: true });
      });
    } finally {
      await link.close();
    }
  });

  it('of the page itself, which then reads all that it has missed', async (context) => {
    stage.needs(context, 'stop');
    const relay = await stage.stack.relay();
    await outage(relay, relay, (_, page) => page.stop(), true);
  });

  it('of the robot, of its edge, of the relay', async () => {
    const relay = await stage.stack.relay();
    await outage(relay, relay, async ({ source, edge }) => {
      source.signal('SIGSTOP');
      await pause(OUTAGE_MS);
      source.signal('SIGCONT');
      edge.signal('SIGSTOP');
      await pause(OUTAGE_MS);
      edge.signal('SIGCONT');
      relay.process.signal('SIGSTOP');
      return () => relay.process.signal('SIGCONT');
    });
  });
});

it.skipIf(!FULL).each([
  ['repeats', /HOLDING with an old pose/],
  ['late', /LIVE with an old pose/],
])('a relay that %s is found out: the test would notice', async (breaks, lie) => {
  const relay = await stage.stack.relay({ breaks });
  const robot = new ClockRobot(stage.stack, relay);
  const page = await watched(relay.url);
  await until('it lies', async () => lie.test((await robot.lies(page)).join('; ')));
});
