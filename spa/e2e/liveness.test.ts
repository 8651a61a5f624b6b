import { setTimeout as pause } from 'node:timers/promises';
import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { FaultyLink } from './proxy.ts';
import {
  type ChipChange,
  chips,
  chipText,
  is,
  liveness,
  RECORD,
  SWINGING,
  textOf,
  whole,
} from './robot_page.ts';
import { FULL, setStage } from './stage.ts';
import { ClockRobot, WITNESS } from './truth.ts';

const stage = setStage();

/** A swinging knee, because unchanged poses would be HOLDING. */

const PHONE = { width: 390, height: 844 };

const word = (change: ChipChange): string => change.state;

describe('the four words', () => {
  it('a silent source is STALE "robot silent", a stopped edge STALE and then OFFLINE, each LIVE again; a killed one OFFLINE', async () => {
    const relay = await stage.stack.relay();
    const robot = new ClockRobot(stage.stack, relay);
    const { source, edge } = robot;
    const page = await stage.open(`${relay.url}/#/r/demo`, { preload: `${RECORD};${WITNESS}` });
    await until('LIVE', is(page, 'LIVE'));
    await until('a body', () => whole(page)); // the edge serves its files
    await until('said aloud', async () => /: live/.test(await textOf(page, 'spoken')));
    /** What follows, from now on. */
    const following = async () => {
      const before = (await chips(page)).length; // it may have been OFFLINE if the page opened first
      return async () => (await chips(page)).slice(before).filter(({ state }) => state !== '');
    };

    const silent = await following();
    source.signal('SIGSTOP');
    await until('STALE', is(page, 'STALE'));
    expect(await chipText(page)).toMatch(/robot silent/i);
    await until('said aloud', async () => /: stale, robot silent/.test(await textOf(page, 'spoken')));
    await pause(4000); // longer than a lease: it must not become OFFLINE, because the edge is running
    expect(await liveness(page)).toBe('STALE');
    source.signal('SIGCONT');
    await until('LIVE again', is(page, 'LIVE'));
    expect((await silent()).map(word)).not.toContain('OFFLINE');

    const stopped = await following();
    edge.signal('SIGSTOP');
    await until('OFFLINE', is(page, 'OFFLINE'));
    expect((await stopped()).map(word)).toEqual(['STALE', 'OFFLINE']);
    edge.signal('SIGCONT');
    await until('LIVE again', is(page, 'LIVE'));

    await edge.kill();
    await until('OFFLINE', is(page, 'OFFLINE'));
    expect(await robot.lies(page)).toEqual([]);
  });

  it('a robot that sends too much is LIVE and is said to, until it no longer does', async () => {
    // far below 30: on a busy machine frames are late, and the edge halves its rate once or twice
    const relay = await stage.stack.relay({ viewFrames: 7 });
    const { source } = stage.stack.fedEdge(relay, SWINGING);
    const page = await stage.open(`${relay.url}/#/r/demo`, { preload: RECORD, viewport: PHONE });
    const says = (what: string, word: RegExp) => until(what, async () => word.test(await chipText(page)));
    await says('that it sends too much', /^LIVE.*robot sends too much$/);
    const before = (await chips(page)).length; // it may have been OFFLINE if the page opened first
    await page.screenshot('over-share-phone.png');
    expect(
      await page.evaluate<boolean>(
        `[...document.querySelectorAll('.chip-warning')].every((words) => words.scrollWidth <= words.clientWidth)`,
      ),
      'all of it is to be seen',
    ).toBe(true);

    source.write(JSON.stringify({ ...SWINGING, hz: 5 }));
    await says('nothing more of it', /^LIVE(?!.*too much)/);
    expect((await chips(page)).slice(before).map(word)).not.toContain('OFFLINE');
  });

  it('who joins a dead robot never sees LIVE', async () => {
    const relay = await stage.stack.relay();
    const { source, edge } = stage.stack.fedEdge(relay, SWINGING);
    await until('the relay has the robot', async () => {
      const robots = JSON.stringify(await relay.json('/api/v1/robots'));
      return robots.includes('"online"');
    });

    // its source is dead, its edge alive
    source.signal('SIGSTOP');
    await until('the relay calls it silent', async () => {
      const robots = JSON.stringify(await relay.json('/api/v1/robots'));
      return robots.includes('"silent"');
    });
    const silent = await stage.open(`${relay.url}/#/r/demo`, { preload: RECORD });
    await until('STALE', is(silent, 'STALE'));
    await pause(2500);
    expect((await chips(silent)).map(word)).not.toContain('LIVE');
    expect((await chips(silent)).map(word)).not.toContain('HOLDING');

    // now both are dead
    await edge.kill();
    const dead = await stage.open(`${relay.url}/#/r/demo`, { preload: RECORD });
    await until('OFFLINE', is(dead, 'OFFLINE'));
    await pause(2500);
    const words = (await chips(dead)).map(word);
    expect(words).not.toContain('LIVE');
    expect(words).not.toContain('HOLDING');
  });

  it("a frozen network, a cut one and a killed relay are STALE 'no connection'; the page comes back by itself", async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, SWINGING, { keyInterval: 30 });
    const link = await FaultyLink.open(relay.port);
    try {
      const page = await stage.open(`${link.url}/#/r/demo`, { preload: RECORD });
      await until('LIVE', is(page, 'LIVE'));
      const isLost = async () => {
        await until('STALE', is(page, 'STALE'));
        expect(await chipText(page)).toMatch(/no connection/i);
      };

      link.fault({ frozen: true });
      await isLost();
      link.heal();
      await until('LIVE again', is(page, 'LIVE'));

      const before = (await chips(page)).length;
      link.cut();
      await until(
        'connected once more',
        async () => link.connections > 0 && (await liveness(page)) === 'LIVE',
      );
      expect((await chips(page)).slice(before).map(word)).not.toContain('OFFLINE');

      await relay.process.kill();
      await isLost();
      await stage.stack.relay({ httpPort: relay.port, zenohPort: Number(relay.zenoh.split(':').at(-1)) });
      await until('LIVE again', is(page, 'LIVE'));
    } finally {
      await link.close();
    }
  });

  it.runIf(FULL)(
    'nothing false in five minutes with 400 ms of jitter',
    async () => {
      const relay = await stage.stack.relay();
      stage.stack.fedEdge(relay, SWINGING, { robot: 'swings' });
      stage.stack.fedEdge(relay, { pos: { RKN: 0, LKN: 0.2 } }, { robot: 'stands' });
      const { edge } = stage.stack.fedEdge(relay, SWINGING, { robot: 'left' });
      const link = await FaultyLink.open(relay.port);
      try {
        link.fault({ delayMs: 400, jitterMs: 400 });
        await until('three robots', async () => {
          const robots = JSON.stringify(await relay.json('/api/v1/robots'));
          return ['swings', 'stands', 'left'].every((robot) => robots.includes(robot));
        });
        await edge.kill();
        const said = { swings: 'LIVE', stands: 'HOLDING', left: 'OFFLINE' };
        const watched = [];
        for (const [robot, expected] of Object.entries(said)) {
          const page = await stage.open(`${link.url}/#/r/${robot}`, { preload: RECORD });
          await until(expected, is(page, expected));
          watched.push({ page, robot, expected });
        }
        // a page that opens beside another may need the whole machine: count from when all are up
        const before = new Map<Page, number>();
        for (const { page, expected } of watched) {
          await until(`${expected} once more`, is(page, expected));
          before.set(page, (await chips(page)).length);
        }
        await pause(300_000);
        for (const { page, robot, expected } of watched) {
          const since = (await chips(page)).slice(before.get(page));
          expect(since, `${robot} was ${expected} all the time`).toEqual([]);
          console.log(`${robot}: ${expected} for five minutes; ${await chipText(page)}`);
        }
      } finally {
        await link.close();
      }
    },
    420_000,
  );
});
