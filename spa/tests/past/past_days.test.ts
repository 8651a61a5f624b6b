import { createHash } from 'node:crypto';
import { describe, expect, it } from 'vitest';
import type { PastSink, Span } from '../../src/past/past_types.ts';
import { PastPlayer } from '../../src/past/player/past_player.ts';
import { OwnTape } from '../../src/past/player/tape/own_tape.ts';
import { Month, type MonthOptions } from '../rigs/past_month.ts';
import { FakeSink } from '../rigs/past_player_rig.ts';
import { recorded, SCHEMA, sent } from '../rigs/past_recordings.ts';
import { json, PastRig, settled } from '../rigs/past_rig.ts';

const TO_MS = Date.UTC(2026, 10, 24, 12);
const DAY_MS = 86_400_000;
const MIN_MS = 60_000;
const HOUR_MS = 60 * MIN_MS;
const SHA = createHash('sha256').update(SCHEMA.text).digest('hex');
/** Four seconds at 30 Hz: the size of a minute in an index does not depend on the motion. */
const GIVEN = recorded(sent(120, { everyMs: 33, keyEveryS: 10 }), { schemaSha: SHA });

/** A page that looks back on 31 full days, and its requests. */
class Visit {
  readonly rig = new PastRig();
  readonly sink = new FakeSink();
  readonly asked: { path: string; bytes: number }[] = [];
  readonly source;
  readonly player;

  constructor(options: Partial<MonthOptions> = {}, sink: PastSink | null = null) {
    const { rig } = this;
    const month = new Month(GIVEN, { toMs: TO_MS, schemaText: SCHEMA.text, ...options });
    const get = (path: string) => () => {
      const told = month.answer(path);
      if (told === null) return json({}, 404);
      const body = typeof told.body === 'string' ? new TextEncoder().encode(told.body) : told.body;
      this.asked.push({ path, bytes: body.length });
      return new Response(body, { headers: { 'content-type': told.type } });
    };
    rig.answers.get = (path: string) => get(path);
    this.source = rig.open();
    this.player = new PastPlayer({
      ...{ source: this.source, own: new OwnTape(), sink: sink ?? this.sink, heard: () => [] },
      nowMs: () => rig.clock.nowMs,
      schedule: (run, afterMs) => rig.clock.later(afterMs, run),
    });
  }

  /** Time passes, with pictures. */
  async pass(ms: number): Promise<void> {
    for (let left = ms; left > 0; left -= 100) {
      await this.rig.clock.pass(Math.min(100, left));
      if (this.player.playhead.at === 'past') this.player.tick();
      await settled();
    }
  }

  /** Lets time pass until a condition holds: hashes are computed in another thread. */
  async until(is: () => boolean): Promise<void> {
    for (let i = 0; i < 200 && !is(); i += 1) {
      await this.pass(100);
      await new Promise((resolve) => setTimeout(resolve, 5));
    }
    expect(is()).toBe(true);
  }

  /** Lets time pass until a segment has been requested and shown. */
  shown(): Promise<void> {
    return this.until(() => this.player.frame !== null);
  }

  takePaths(): string[] {
    const paths = this.asked.map(({ path }) => path);
    this.asked.length = 0;
    return paths;
  }

  close(): void {
    this.player.close();
    this.source.close();
  }
}

const isSegment = (path: string) => /\/[0-9a-f]{16}\/\d+$/.test(path);

describe('a month of one robot, recorded day and night', () => {
  it('opens at any minute with at most 6 requests and 300 kB before its segment', async () => {
    const told: string[] = [];
    for (const [ago, hasLine] of [
      [31 * DAY_MS - 5 * MIN_MS, true],
      [17 * DAY_MS + 7 * HOUR_MS + 13 * MIN_MS, true],
      [9 * DAY_MS + 12 * HOUR_MS + 1000, false], // just after midnight UTC
      [DAY_MS, true],
      [3 * HOUR_MS + 200, true], // just after the beginning of ten minutes
      [90 * MIN_MS, false],
    ] as const) {
      const visit = new Visit();
      const momentMs = TO_MS - ago;
      visit.player.openAt(momentMs);
      // as the time line does once it is known how far back the past reaches
      if (hasLine) visit.player.look({ fromMs: momentMs - 90 * MIN_MS, toMs: momentMs + 90 * MIN_MS });
      await visit.shown();
      const before = visit.asked.filter(({ path }) => !isSegment(path));
      // the page asks whether there is a past before any of this is fetched
      const requests = before.length + 1;
      const bytes = before.reduce((sum, each) => sum + each.bytes, before[0]!.bytes);
      told.push(`${(ago / HOUR_MS).toFixed(1)} h ago: ${requests} requests, ${bytes} bytes`);
      expect(requests).toBeLessThanOrEqual(6);
      expect(bytes).toBeLessThanOrEqual(300_000);
      visit.close();
    }
    console.info(told.join('\n'));
  });

  it('asks for no day that nobody looks at', async () => {
    const visit = new Visit();
    await visit.pass(60_000);
    expect(new Set(visit.takePaths())).toEqual(new Set(['']));
    const { unknown } = visit.player.timeline!;
    expect(unknown).toHaveLength(32);
    visit.player.look({ fromMs: TO_MS - 3 * HOUR_MS, toMs: TO_MS });
    await visit.pass(1000);
    expect(visit.takePaths()).toEqual(['/public/2026-11-24']);
    visit.player.look({ fromMs: TO_MS - 7 * DAY_MS, toMs: TO_MS });
    await visit.pass(1000);
    const days = visit.takePaths();
    expect(days[0], 'the newest first').toBe('/public/2026-11-23');
    expect(days).toHaveLength(7);
    await visit.pass(60_000);
    expect(visit.takePaths().filter((path) => path !== '')).toEqual([]);
    visit.close();
  });

  it('does not ask for a day again while it is away at once', async () => {
    const visit = new Visit();
    await visit.pass(1000);
    visit.rig.answers.get = () => () => json({}, 503);
    const look = () => visit.player.look({ fromMs: TO_MS - 7 * DAY_MS, toMs: TO_MS });
    look();
    for (let i = 0; i < 20; i += 1) {
      await visit.pass(100);
      look();
    }
    expect(visit.rig.takeAsked().length).toBeLessThanOrEqual(20);
    visit.close();
  });
});

describe('a drag across hours', () => {
  it('asks for nothing while the finger moves, and for one page of first poses at each rest', async () => {
    const visit = new Visit();
    const { player } = visit;
    const span = { fromMs: TO_MS - 7 * DAY_MS, toMs: TO_MS };
    await visit.pass(1000);
    player.look(span);
    await visit.pass(2000);
    visit.takePaths();
    for (let i = 0; i < 60; i += 1) {
      player.seek(TO_MS - DAY_MS - i * 2 * HOUR_MS, true);
      await visit.pass(100);
    }
    expect(visit.takePaths().filter((path) => path.includes('keys'))).toEqual([]);
    for (const rest of [1, 2, 3]) {
      const restMs = TO_MS - rest * DAY_MS - 20 * MIN_MS;
      player.seek(restMs, true);
      await visit.pass(1000);
      const paths = visit.takePaths().filter((path) => path !== '');
      expect(paths.filter((path) => path.includes('keys'))).toHaveLength(1);
      expect(paths[0]).toMatch(/keys\?every=15$/);
      expect(paths.filter((path) => !/keys|schema/.test(path))).toEqual([]);
      await visit.until(() => visit.sink.newest !== undefined && restMs - visit.sink.newest.atMs < MIN_MS);
      const { atMs } = visit.sink.newest!;
      expect(restMs - atMs, 'a pose of that minute').toBeLessThan(MIN_MS);
      expect(restMs - atMs).toBeGreaterThanOrEqual(0);
    }
    player.settle();
    await visit.shown();
    expect(visit.takePaths().filter((path) => path.includes('keys'))).toEqual([]);
    visit.close();
  });

  it('follows the finger through every page on a line of minutes', async () => {
    const visit = new Visit();
    await visit.pass(1000);
    visit.player.look({ fromMs: TO_MS - 30 * MIN_MS, toMs: TO_MS });
    visit.player.seek(TO_MS - 25 * MIN_MS, true);
    await visit.pass(500);
    expect(visit.takePaths().filter((path) => /T11:30Z\/keys$/.test(path))).toHaveLength(1);
    visit.close();
  });
});

describe('what lies between days', () => {
  /** Recorded for an hour a day, from noon of UTC. */
  const noons = {
    isRecorded: (atMs: number) => atMs % DAY_MS >= 12 * HOUR_MS && atMs % DAY_MS < 13 * HOUR_MS,
  };

  it('is passed over in play, a day at a time, to the next that was recorded', async () => {
    const visit = new Visit(noons);
    const endMs = TO_MS - 4 * DAY_MS + HOUR_MS;
    visit.player.openAt(endMs - 3000);
    await visit.shown();
    visit.player.toggle();
    const hour = () => new Date(visit.player.playhead.momentMs).toISOString().slice(0, 13);
    await visit.until(() => hour() !== '2026-11-20T12' && hour() !== '2026-11-20T13');
    expect(visit.player.playhead.at).toBe('past');
    expect(hour()).toBe('2026-11-21T12');
    const days = visit.asked.map(({ path }) => path).filter((path) => /\d{4}-\d\d-\d\d$/.test(path));
    expect(new Set(days).size).toBeLessThanOrEqual(3);
    visit.close();
  });

  it('shows the newest pose before, also when that lies on an unknown day', async () => {
    const visit = new Visit(noons);
    await visit.pass(1000);
    visit.player.toggle();
    visit.player.seek(TO_MS - 4 * DAY_MS - HOUR_MS); // an hour before what was recorded that day
    await visit.shown();
    expect(new Date(visit.player.frame!.atMs).toISOString().slice(0, 16)).toBe('2026-11-19T12:59');
    visit.close();
  });

  it('leads a moment that was named to what is nearest, before or after', async () => {
    for (const [hours, shown] of [
      [-1, '2026-11-20T12:00'],
      [3, '2026-11-20T12:59'],
    ] as const) {
      const visit = new Visit(noons);
      visit.player.openAt(TO_MS - 4 * DAY_MS + hours * HOUR_MS);
      await visit.shown();
      expect(new Date(visit.player.frame!.atMs).toISOString().slice(0, 16)).toBe(shown);
      expect(visit.player.playhead).toMatchObject({ note: 'not-kept', playing: false });
      visit.close();
    }
  });

  it('is searched for the fault before, a week at a press', async () => {
    const atMs = TO_MS - 6 * DAY_MS;
    const visit = new Visit({ faults: (minuteMs) => (minuteMs === atMs ? 1 : 0) });
    await visit.pass(1000);
    visit.player.visitFault(-1);
    await visit.shown();
    const { momentMs } = visit.player.playhead;
    expect(momentMs).toBeGreaterThanOrEqual(atMs + 1000 - 2000);
    expect(momentMs, 'it plays on from there').toBeLessThan(atMs);
    visit.close();
  });
});

describe('how often a fault came', () => {
  it('is known after a jump, also of what lies in the ten minutes before those of the moment', async () => {
    const perMinute = 2;
    const visit = new Visit({ faults: () => perMinute });
    const momentMs = TO_MS - 5 * DAY_MS + 3 * MIN_MS + 59_000;
    visit.player.openAt(momentMs);
    await visit.shown();
    const begun = () => visit.sink.since.filter((told) => told === 'bigError on').length;
    await visit.until(() => begun() === 10 * perMinute);
    await visit.pass(2000);
    expect(begun(), 'in ten minutes').toBe(10 * perMinute);
    visit.close();
  });

  it('is not asked for where the day tells that there was none', async () => {
    const visit = new Visit();
    const momentMs = TO_MS - 5 * DAY_MS + 3 * MIN_MS;
    visit.player.look({ fromMs: momentMs, toMs: momentMs + 1 });
    await visit.pass(1000);
    visit.player.openAt(momentMs);
    await visit.shown();
    await visit.pass(2000);
    const pages = visit.asked.map(({ path }) => path).filter((path) => /T\d\d:\d\dZ$/.test(path));
    expect(pages).toEqual(['/public/2026-11-19T12:00Z']);
    visit.close();
  });
});

describe('a span that is repeated', () => {
  it('stays while a finger drags, and who ends it by going elsewhere is told', async () => {
    const visit = new Visit();
    const { player } = visit;
    const loop: Span = { fromMs: TO_MS - HOUR_MS, toMs: TO_MS - HOUR_MS + 5000 };
    await visit.pass(1000);
    player.setLoop(loop);
    await visit.shown();
    player.seek(TO_MS - 2 * HOUR_MS, true);
    expect(player.playhead.loop).toEqual(loop);
    player.seek(loop.fromMs + 1000, true);
    player.settle();
    expect(player.playhead).toMatchObject({ loop, note: null });
    player.seek(TO_MS - 2 * HOUR_MS, true);
    player.settle();
    expect(player.playhead).toMatchObject({ loop: null, note: 'unlooped' });
    visit.close();
  });
});
