import { describe, expect, it } from 'vitest';
import { CONNECT_LIMIT_MS, SILENT_LIMIT_MS } from '../../src/stream/session.ts';
import { WITHOUT_MS } from '../../src/stream/transport.ts';
import { Frames, SCHEMA } from '../rigs/schema.ts';
import { OPENING_MS, opened, RELAY_MS, Rig } from '../rigs/session_rig.ts';

describe('connecting', () => {
  it('asks for the rate in the address', () => {
    const rig = new Rig();
    rig.do(rig.session.start(rig.now));
    expect(rig.take()).toEqual([
      {
        do: 'post',
        message: {
          kind: 'link',
          by: 'websocket',
          phase: 'connecting',
          retryAtMs: null,
          ending: null,
          moves: false,
        },
      },
      { do: 'connect', by: 'websocket', url: 'ws://relay/live?hz=30' },
    ]);
  });

  it('gives up on what does not open, and goes on trying by turns', () => {
    const rig = new Rig(0);
    rig.do(rig.session.start(rig.now));
    rig.pass(WITHOUT_MS);
    expect(rig.asked()).toEqual(['ws://relay/live?hz=30', 'http://relay/live.sse?hz=30']);
    rig.pass(CONNECT_LIMIT_MS);
    rig.take();
    rig.pass(250);
    expect(rig.session.phase).toBe('waiting');
    expect(rig.take().map((action) => action.do)).toEqual(['drop', 'post']);
    rig.pass(250);
    expect(rig.asked()).toEqual(['ws://relay/live?hz=30']);
    rig.pass(WITHOUT_MS);
    expect(rig.asked()).toEqual(['http://relay/live.sse?hz=30']);
  });

  it('backs off with full jitter, and starts anew after a connection that worked', () => {
    const rig = new Rig(1);
    rig.do(rig.session.start(rig.now));
    const waits: number[] = [];
    for (let failure = 0; failure < 8; failure++) {
      rig.take();
      rig.do(rig.session.closed(rig.now, 1006, ''));
      const [link] = rig.posts('link');
      waits.push((link?.retryAtMs ?? 0) - rig.now);
      rig.pass(waits.at(-1) ?? 0);
      expect(rig.session.phase).toBe('connecting');
    }
    expect(waits).toEqual([500, 1000, 2000, 4000, 8000, 16_000, 30_000, 30_000]);
    rig.do(rig.session.opened(rig.now));
    rig.passWithStatus(6000);
    rig.take();
    rig.do(rig.session.closed(rig.now, 1006, ''));
    expect(rig.posts('link')[0]?.retryAtMs).toBe(rig.now + 500);
  });

  it('a relay that lets everyone in and throws them out does not start the backoff anew', () => {
    const rig = new Rig(1);
    rig.do(rig.session.start(rig.now));
    const waits: number[] = [];
    for (let failure = 0; failure < 3; failure++) {
      rig.do(rig.session.opened(rig.now));
      rig.status();
      rig.take();
      rig.do(rig.session.closed(rig.now, 1006, ''));
      waits.push((rig.posts('link')[0]?.retryAtMs ?? 0) - rig.now);
      rig.pass(waits.at(-1) ?? 0);
    }
    expect(waits).toEqual([500, 1000, 2000]);
  });
});

describe('a socket that died without saying so', () => {
  it('is dropped after three silent seconds', () => {
    const rig = opened();
    rig.pass(SILENT_LIMIT_MS);
    expect(rig.session.phase).toBe('open');
    rig.take();
    rig.pass(250);
    expect(rig.session.phase).toBe('waiting');
    expect(rig.take()[0]).toEqual({ do: 'drop' });
  });

  it('is kept by a thread that did not run: it reads first what arrived meanwhile', () => {
    const rig = opened();
    rig.take();
    const fromMs = rig.now;
    rig.now += 2 * SILENT_LIMIT_MS;
    rig.do(rig.session.tick(rig.now));
    expect(rig.session.phase).toBe('open');
    expect(rig.posts('held-up')).toEqual([{ kind: 'held-up', fromMs, toMs: rig.now }]);
    rig.pass(250);
    expect(rig.session.phase, 'nothing had arrived').toBe('waiting');
  });

  it('is not what a quiet robot looks like: status comes each second', () => {
    const rig = opened();
    rig.passWithStatus(60_000);
    expect(rig.session.phase).toBe('open');
  });

  it('is replaced at once when the page wakes up and nothing was heard lately', () => {
    const rig = opened();
    rig.now += 2000;
    rig.do(rig.session.wake(rig.now));
    expect(rig.take().map((action) => action.do)).toEqual(['drop', 'post', 'connect']);
  });

  it('is kept when the page wakes up and the relay has just spoken', () => {
    const rig = opened();
    rig.now += 500;
    rig.do(rig.session.wake(rig.now));
    expect(rig.take()).toEqual([]);
  });
});

describe('acknowledging', () => {
  const acks = (rig: Rig) => rig.sent().filter((m) => (m as { type: string }).type === 'ack');

  it('twice a second from afar, or the relay would wait for it and hold frames back', () => {
    const rig = new Rig();
    rig.open();
    rig.schema();
    rig.pass(250);
    const [ping] = rig.sent().filter((m) => (m as { type: string }).type === 'ping') as { t: number }[];
    rig.pass(600);
    rig.pong(ping!.t);
    rig.next();
    expect(acks(rig)).toEqual([{ type: 'ack', n: 1 }]);
    rig.pass(499);
    rig.next();
    expect(acks(rig)).toEqual([]);
    rig.pass(1);
    expect(acks(rig)).toEqual([{ type: 'ack', n: 2 }]);
  });

  it('counts the binary messages of this connection, at most once a second, and owes nothing for longer', () => {
    const rig = opened();
    rig.next();
    expect(acks(rig)).toEqual([{ type: 'ack', n: 1 }]);
    for (let i = 0; i < 29; i++) {
      rig.now += 33;
      rig.next();
    }
    expect(acks(rig)).toEqual([]);
    rig.pass(250); // no further frame arrives
    expect(acks(rig)).toEqual([{ type: 'ack', n: 30 }]);
    rig.passWithStatus(5000);
    expect(acks(rig)).toEqual([]);
  });

  it('counts frames that it could not read too', () => {
    const rig = opened();
    rig.frame(Uint8Array.of(0x13, 1, 2));
    expect(acks(rig)).toEqual([{ type: 'ack', n: 1 }]);
  });

  it('starts from nothing on a new connection', () => {
    const rig = opened();
    rig.frame(new Frames().next());
    rig.do(rig.session.closed(rig.now, 1006, ''));
    rig.pass(1000);
    rig.do(rig.session.opened(rig.now));
    rig.schema();
    rig.take();
    rig.frame(new Frames().next());
    expect(acks(rig)).toEqual([{ type: 'ack', n: 1 }]);
  });
});

describe('a hidden page', () => {
  const rates = (rig: Rig) => rig.sent().filter((m) => (m as { type: string }).type === 'rate');

  it('asks for no poses, and for them again when it is looked at', () => {
    const rig = opened();
    rig.do(rig.session.visibility(rig.now, false));
    expect(rates(rig)).toEqual([{ type: 'rate', hz: 0 }]);
    rig.passWithStatus(10_000);
    expect(rates(rig)).toEqual([]);
    rig.do(rig.session.visibility(rig.now, true));
    expect(rates(rig)).toEqual([{ type: 'rate', hz: 30 }]);
  });

  it('is no flood when a person flips through tabs: the last wish counts', () => {
    const rig = opened();
    for (let flip = 0; flip < 20; flip++) {
      rig.now += 10;
      rig.do(rig.session.visibility(rig.now, flip % 2 === 1));
    }
    rig.pass(1000);
    expect(rates(rig)).toEqual([
      { type: 'rate', hz: 0 },
      { type: 'rate', hz: 30 },
    ]);
  });

  it('that opens hidden says so at once', () => {
    const rig = new Rig(0.5, false);
    rig.open();
    expect(rates(rig)).toEqual([{ type: 'rate', hz: 0 }]);
  });
});

describe('frames', () => {
  const states = (rig: Rig) => rig.posts('state').map((message) => message.state);

  it('become states with their schema, number, time and codes', () => {
    const rig = opened();
    rig.frame(new Frames(41).next({ 'pos.RKN': 480 }));
    const [state] = states(rig);
    const pos = SCHEMA.field('pos');
    expect(state).toMatchObject({ schemaId: SCHEMA.id, seq: 41, atMs: rig.now });
    expect(state?.codes[(pos?.start ?? 0) + 1]).toBe(480);
  });

  it('whose base is not here change nothing, until a KEY mends it', () => {
    const rig = opened();
    rig.frames.next(); // the KEY that is lost in transit
    rig.next();
    expect(states(rig)).toEqual([]);
    rig.next({}, true);
    expect(states(rig).map((s) => s.seq)).toEqual([3]);
  });

  it('are fresh only when newer than what status knew: a last pose is none', () => {
    const rig = new Rig();
    rig.open();
    rig.status({ robot: 'silent', age_ms: 60_000, seq: 2 });
    rig.schema();
    rig.next(); // a KEY, for the next to build on
    rig.next();
    expect(states(rig)).toMatchObject([{ seq: 2, freshMs: null, bornMs: rig.now - 60_000 }]);
    rig.now += 100;
    rig.next();
    expect(states(rig)).toMatchObject([{ seq: 3, freshMs: rig.now, bornMs: rig.now }]);
  });

  it('come with what the relay says of their sender: that it sends too much, and that it no longer does', () => {
    const rig = opened();
    rig.status({ over_share: true });
    rig.status();
    expect(rig.posts('status').map(({ status }) => status.overShare)).toEqual([true, false]);
  });

  it('are as old as they have been here, whatever a status says that took its time', () => {
    const rig = opened();
    rig.frame(new Frames(1).next());
    rig.now += 1000;
    rig.say({ type: 'info', kv: {} });
    rig.now += 700;
    rig.take();
    rig.status({ seq: 1, age_ms: 900 });
    rig.status({ seq: 2, age_ms: 900 }); // of one that is not loaded yet
    expect(rig.posts('status').map(({ status }) => status.ageMs)).toEqual([1700, 900]);
  });

  it('tell when the pose last changed', () => {
    const rig = opened();
    const startMs = rig.now;
    rig.next();
    rig.now += 500;
    rig.next({ 'cur.RKN': 5 });
    expect(states(rig).map((s) => s.changedMs)).toEqual([startMs, startMs]);
    rig.now += 500;
    rig.next({ 'pos.RKN': 1 });
    expect(states(rig)[0]?.changedMs).toBe(rig.now);
  });

  it('after a pause in which nobody looked claim no stillness', () => {
    const rig = opened();
    rig.next();
    rig.passWithStatus(10_000);
    rig.take();
    rig.next();
    expect(states(rig)[0]?.changedMs).toBe(rig.now);
  });

  it('coded against a KEY and isolated ones are read alike', () => {
    const rig = opened();
    for (let i = 0; i < 6; i++) rig.next({ 'pos.RKN': i }, i === 3);
    const pos = SCHEMA.field('pos');
    expect(states(rig).map((s) => s.codes[(pos?.start ?? 0) + 1])).toEqual([0, 1, 2, 3, 4, 5]);
  });

  it('of a new run are shown though their numbers begin anew', () => {
    const rig = opened();
    rig.frame(new Frames(5000).next());
    rig.frame(new Frames(1).next());
    expect(states(rig).map((s) => s.seq)).toEqual([5000, 1]);
  });
});

describe('what the relay says', () => {
  it('is passed on', () => {
    const rig = opened();
    const hash = 'a'.repeat(64);
    rig.hello({ hz: 10, model: hash });
    rig.say({ type: 'rate', hz: 5, reason: 'slow network' });
    rig.say({ type: 'info', kv: { mode: 'walking' } });
    rig.say({ type: 'event', n: 1, t: 2, at: 3, level: 'fault', source: 'RKN', text: 'jam', state: 'on' });
    const posts = rig.take().flatMap((action) => (action.do === 'post' ? [action.message] : []));
    expect(posts).toEqual([
      { kind: 'rate', hz: 10, reason: null },
      { kind: 'model', hash },
      { kind: 'behind', ms: null },
      { kind: 'rate', hz: 5, reason: 'slow network' },
      { kind: 'info', kv: new Map([['mode', 'walking']]) },
      { kind: 'event', event: expect.objectContaining({ n: 1, source: 'RKN' }) },
    ]);
  });

  it('tells a delayed audience how far behind it is', () => {
    const rig = opened();
    rig.hello({ limits: { delay_s: 300 } });
    expect(rig.posts('behind')).toEqual([{ kind: 'behind', ms: 300_000 }]);
  });

  it('may be more than this page knows, or nonsense', () => {
    const rig = opened();
    for (const text of ['{"type":"weather"}', 'nonsense', '[]', 'null', '{"type":"status"}']) {
      rig.do(rig.session.text(rig.now, text));
    }
    expect(rig.take()).toEqual([]);
  });

  it('about itself may be unreadable: the page says so and keeps the connection', () => {
    const rig = opened();
    rig.say({ type: 'schema', v: 1, robot: 'x', labels: {}, fields: [{ name: 'pos', labels: 'none' }] });
    const [problem] = rig.posts('problem');
    expect(problem?.problem.detail).toContain('fields[0].labels');
    expect(rig.session.phase).toBe('open');
  });

  it('is as old as the way back may be long, by WebSocket too', () => {
    const rig = new Rig();
    const [UP_MS, DOWN_MS] = [20, 4000];
    rig.do(rig.session.start(rig.now));
    rig.pass(UP_MS + DOWN_MS);
    rig.do(rig.session.opened(rig.now));
    const status = (changed = {}) => rig.status({ clock_ms: RELAY_MS + rig.now - DOWN_MS, ...changed });
    status();
    rig.schema();
    rig.next();
    const of = (found: Rig) => found.posts('state').at(-1)?.state;
    expect(of(rig)).toMatchObject({ transitMs: 4020, freshMs: rig.now - 4020, lateMs: 0 });
    rig.pass(250);
    const t = rig.now;
    for (let second = 0; second < 4; second++) {
      rig.now += 1000;
      status();
    }
    rig.now += UP_MS;
    rig.say({ type: 'pong', t, clock_ms: RELAY_MS + t + UP_MS });
    rig.next();
    expect(Math.round(of(rig)!.transitMs!)).toBe(4020);
    status({ clock_ms: RELAY_MS + rig.now - 100 });
    rig.next();
    expect(Math.round(of(rig)!.transitMs!), 'the buffer has emptied').toBe(120);
    expect(rig.posts('pace')).toEqual([]);
    rig.pass(1000);
    expect(Math.round(rig.posts('pace')[0]!.lateMs!)).toBe(120);
  });

  it('from a relay that does not tell its clock is as old as a round trip', () => {
    const rig = new Rig();
    rig.open();
    rig.status({ clock_ms: undefined });
    rig.schema();
    const t = rig.now;
    for (let second = 0; second < 4; second++) {
      rig.pass(1000);
      rig.status({ clock_ms: undefined });
    }
    rig.next();
    expect(rig.posts('state').at(-1)?.state.transitMs, 'the connection').toBe(4000);
    rig.say({ type: 'pong', t: t + 1000 });
    rig.pass(1000);
    rig.next();
    expect(rig.posts('state').at(-1)?.state.transitMs).toBe(3000);
  });

  it('comes with a round trip and a measured rate', () => {
    const rig = opened();
    rig.pass(250);
    const ping = rig.sent().find((m) => (m as { type: string }).type === 'ping') as { t: number };
    rig.now += 40;
    rig.pong(ping.t);
    for (let i = 0; i < 60; i++) {
      rig.now += 50;
      rig.next();
      rig.do(rig.session.tick(rig.now));
    }
    const pace = rig.posts('pace').at(-1);
    expect(pace?.hz).toBeCloseTo(20, 0);
    expect(pace?.roundTripMs).toBe(40);
  });
});

describe('where no WebSocket gets through', () => {
  const EVENTS = 'http://relay/live.sse?hz=30';

  function onEvents(): Rig {
    const rig = new Rig();
    rig.fallBack();
    rig.schema();
    rig.take();
    return rig;
  }

  it('two openings that fail are enough; it says by what it comes', () => {
    const rig = new Rig();
    rig.fallBack();
    const done = rig.take();
    expect(done.flatMap((action) => (action.do === 'connect' ? [action.url] : []))).toEqual([
      'ws://relay/live?hz=30',
      'ws://relay/live?hz=30',
      EVENTS,
    ]);
    const links = done.flatMap((action) =>
      action.do === 'post' && action.message.kind === 'link' ? [action.message] : [],
    );
    expect(links.at(-1)).toMatchObject({ by: 'events', phase: 'open' });
  });

  it('so is a WebSocket that opens and brings nothing', () => {
    const rig = new Rig(0);
    rig.do(rig.session.start(rig.now));
    for (let i = 0; i < 2; i++) {
      rig.do(rig.session.opened(rig.now));
      rig.pass(SILENT_LIMIT_MS + 500);
    }
    expect(rig.asked().at(-1)).toBe(EVENTS);
  });

  it('nothing is said to the relay, and a WebSocket is tried beside it, more and more seldom', () => {
    const rig = onEvents();
    const tries: number[] = [];
    const began = rig.now;
    while (rig.now - began < 400_000) {
      rig.pass(1000);
      rig.status();
      rig.next();
      const done = rig.take();
      expect(done.some((action) => action.do === 'send')).toBe(false);
      if (done.some((action) => action.do === 'try')) tries.push(Math.round((rig.now - began) / 1000));
    }
    expect(tries).toEqual([1, 31, 91, 211]);
    rig.do(rig.session.wake(rig.now));
    rig.pass(250);
    expect(rig.take()).toContainEqual({ do: 'try', url: 'ws://relay/live?hz=30' });
    rig.do(rig.session.moved(rig.now));
    rig.status();
    expect(rig.posts('link').at(-1)).toMatchObject({ by: 'websocket', phase: 'open' });
    rig.do(rig.session.closed(rig.now, 1006, ''));
    rig.pass(1000);
    expect(rig.asked(), 'what has worked is tried first').toEqual(['ws://relay/live?hz=30']);
  });

  it('a page that nobody sees gives the stream back at once, and asks for it again at once', () => {
    const rig = onEvents();
    rig.do(rig.session.visibility(rig.now, false));
    const given = { phase: 'waiting', by: 'events', retryAtMs: null };
    expect(rig.take().filter(({ do: what }) => what !== 'post')).toEqual([{ do: 'drop' }]);
    rig.pass(60_000);
    rig.do(rig.session.wake(rig.now)); // such as when the network is back
    rig.do(rig.session.renew(rig.now, 'T'));
    expect(rig.asked()).toEqual([]);
    rig.do(rig.session.visibility(rig.now, true));
    expect(rig.asked()).toEqual([EVENTS]);
    rig.do(rig.session.opened(rig.now));
    rig.do(rig.session.visibility(rig.now, false));
    expect(rig.posts('link').at(-1)).toMatchObject(given);
  });

  it('a page that opens hidden holds no stream until it is seen', () => {
    const rig = new Rig(0.5, false);
    rig.do(rig.session.start(rig.now));
    for (let failure = 0; failure < 2; failure++) {
      rig.do(rig.session.closed(rig.now, 1006, ''));
      rig.pass(1000);
    }
    rig.pass(60_000);
    expect(rig.asked()).toEqual(Array(2).fill('ws://relay/live?hz=30'));
    rig.do(rig.session.visibility(rig.now, true));
    expect(rig.asked()).toEqual([EVENTS]);
  });

  it('a page that shows the past asks for another connection without poses, and stays open', () => {
    const rig = onEvents();
    rig.pass(2000);
    rig.status();
    rig.take();
    rig.do(rig.session.visibility(rig.now, false, true));
    expect(rig.take()).toEqual([{ do: 'connect', by: 'events', url: 'http://relay/live.sse?hz=0' }]);
    expect(rig.session.phase).toBe('open');
    rig.do(rig.session.visibility(rig.now, true));
    expect(rig.asked(), 'no flood').toEqual([]);
    rig.pass(2000);
    expect(rig.asked()).toEqual([EVENTS]);
  });

  it('what has lain on its way tells of then', () => {
    const rig = onEvents();
    rig.lateNext(40);
    rig.status();
    rig.take();
    rig.lateNext(1840);
    rig.status();
    const done = rig.take();
    const messages = done.flatMap((action) => (action.do === 'post' ? [action.message] : []));
    const state = messages.find((message) => message.kind === 'state')?.state;
    const mostMs = 1840 + OPENING_MS;
    expect(state).toMatchObject({
      atMs: rig.now,
      lateMs: 1840,
      transitMs: mostMs,
      freshMs: rig.now - mostMs,
    });
    const status = messages.find((message) => message.kind === 'status')?.status;
    expect(status).toMatchObject({ atMs: rig.now - mostMs, heardMs: rig.now - 1840, transitMs: mostMs });
  });

  /** Frames that arrive later and later, as through a filling buffer. */
  function flood(rig: Rig, seconds: number, lateMs: (second: number) => number): string[] {
    const asked: string[] = [];
    for (let second = 0; second < seconds && asked.length === 0; second++) {
      rig.pass(1000);
      rig.status();
      rig.lateNext(lateMs(second));
      asked.push(...rig.asked());
    }
    return asked;
  }

  const asks = (rig: Rig) => rig.take().flatMap((action) => (action.do === 'ask' ? [action.url] : []));
  const PING = 'http://relay/api/v1/ping';

  /** A stream of frames that are this late, while time passes. */
  function flow(rig: Rig, ms: number, lateMs: number): void {
    for (const untilMs = rig.now + ms; rig.now < untilMs; ) {
      rig.pass(250);
      rig.lateNext(lateMs);
    }
  }
  const transitMs = (rig: Rig) => Math.floor(rig.posts('state').at(-1)?.state.transitMs ?? Number.NaN);
  const pong = (t: number, clock_ms: number) => JSON.stringify({ type: 'pong', t, clock_ms });

  it('the relay’s clock is asked for beside a stream that may be late, now and then', () => {
    const rig = new Rig(0.5, true, 'ws://relay/api/v1/robots/r/live');
    rig.fallBack();
    rig.schema();
    rig.take();
    flow(rig, 2000, 0);
    expect(asks(rig), 'it is known well enough').toEqual([]);
    flow(rig, 1000, 1900);
    expect(asks(rig)).toEqual([PING]);
    flow(rig, 60_000, 1900);
    expect(asks(rig), 'each 20 s').toHaveLength(3);
    rig.do(rig.session.visibility(rig.now, false));
    flow(rig, 60_000, 1900);
    expect(asks(rig), 'not for a page that is not seen').toEqual([]);
  });

  it('the answer tells how late the stream is at most, if it is one to this question', () => {
    const rig = onEvents();
    flow(rig, 500, 4000);
    expect(transitMs(rig), 'compared with its opening').toBe(4000 + OPENING_MS);
    const askedMs = rig.now;
    const relayMs = RELAY_MS + askedMs;
    rig.now += 40;
    const useless: [string, string][] = [
      ['a cached answer', pong(askedMs - 3000, relayMs - 3000)],
      ['another relay’s clock', pong(askedMs, relayMs - 1e9)],
      ['another relay’s clock, too', pong(askedMs, relayMs + 1e9)],
      ['no clock', JSON.stringify({ type: 'pong', t: askedMs })],
      ['a page to sign in', '<html>'],
    ];
    for (const [what, text] of useless) {
      rig.do(rig.session.clock(rig.now, askedMs, text));
      flow(rig, 250, 4000);
      expect(transitMs(rig), what).toBe(4000 + OPENING_MS);
    }
    rig.do(rig.session.clock(rig.now, askedMs, pong(askedMs, relayMs + 20)));
    flow(rig, 250, 4000);
    expect(transitMs(rig), 'of 40 ms, half may be the way back').toBe(4020);
    rig.do(rig.session.clock(rig.now, askedMs - 9000, pong(askedMs - 9000, relayMs)));
    flow(rig, 250, 30);
    expect(transitMs(rig), 'a slow answer tells less').toBe(50);
  });

  it('a slow answer may have had to open a connection: once more is asked at once', () => {
    const rig = onEvents();
    const answer = (upMs: number, downMs: number) => {
      const askedMs = rig.now;
      rig.now += upMs + downMs;
      rig.do(rig.session.clock(rig.now, askedMs, pong(askedMs, RELAY_MS + askedMs + upMs)));
      return asks(rig);
    };
    flow(rig, 500, 1300);
    expect(asks(rig)).toHaveLength(1);
    expect(answer(1200, 20)).toHaveLength(1);
    expect(answer(1200, 20), 'but only once').toEqual([]);
    flow(rig, 20_000, 1300);
    expect(asks(rig)).toHaveLength(1);
    expect(answer(20, 20), 'it was not slow').toEqual([]);
  });

  it('a WebSocket that was tried beside the stream counts from when it was tried', () => {
    const rig = onEvents();
    rig.status();
    rig.pass(250);
    expect(rig.take()).toContainEqual({ do: 'try', url: 'ws://relay/live?hz=30' });
    rig.pass(2000);
    rig.do(rig.session.moved(rig.now));
    rig.take();
    rig.status({ seq: 0, clock_ms: RELAY_MS + 5e11 }); // of another relay
    expect(rig.posts('status').at(-1)?.status.transitMs).toBe(2000);
  });

  it('poses that are late twice are asked for more seldom; the person may ask for all of them', () => {
    const rig = onEvents();
    rig.lateNext(0);
    rig.take();
    expect(flood(rig, 20, () => 1900)).toEqual([]);
    expect(flood(rig, 20, (second) => (second % 2) * 2500)).toEqual([]); // never twice
    expect(flood(rig, 20, () => 2500)).toEqual(['http://relay/live.sse?hz=10']);
    rig.hello({ hz: 10 });
    expect(rig.posts('rate').at(-1)).toMatchObject({ hz: 10, reason: 'slow network' });
    rig.lateNext(0);
    expect(flood(rig, 20, () => 2500)).toEqual(['http://relay/live.sse?hz=5']);
    rig.pass(2000);
    rig.status();
    rig.take();
    rig.do(rig.session.wishAll(rig.now));
    expect(rig.asked()).toEqual([EVENTS]);
  });
});

it('asks the relay again for a rate that it has lowered', () => {
  const rig = opened();
  rig.pass(1000);
  rig.status();
  rig.say({ type: 'rate', hz: 5, reason: 'overload' });
  expect(rig.posts('rate')).toEqual([{ kind: 'rate', hz: 5, reason: 'overload' }]);
  rig.do(rig.session.wishAll(rig.now));
  expect(rig.sent()).toEqual([{ type: 'rate', hz: 30 }]);
});
