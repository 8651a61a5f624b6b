import { describe, expect, it } from 'vitest';
import type { Action } from '../../src/stream/messages.ts';
import { Session } from '../../src/stream/session.ts';
import { Rig } from '../rigs/session_rig.ts';

const BYE = { type: 'bye', code: 1013, reason: 'full', retry_s: 30, lane: 'past/public' };
const LANE = { do: 'connect', by: 'segments', url: 'past/public ws://relay/live' };

/** A full relay has named its lane, and the lane runs. */
function inLane(random = 0.5, bye: object = BYE): Rig {
  const rig = new Rig(random);
  rig.open();
  rig.say(bye);
  rig.take();
  rig.do(rig.session.closed(rig.now, 1013, ''));
  return rig;
}

function tries(rig: Rig): string[] {
  return rig.take().flatMap((action) => (action.do === 'try' ? [action.url] : []));
}

describe('a relay that is full', () => {
  it('and names a lane is left for that at once', () => {
    const rig = inLane();
    expect(rig.session.phase).toBe('connecting');
    expect(rig.take()).toEqual([
      {
        do: 'post',
        message: {
          kind: 'link',
          by: 'segments',
          phase: 'connecting',
          retryAtMs: null,
          ending: null,
          moves: false,
        },
      },
      LANE,
    ]);
    rig.do(rig.session.opened(rig.now));
    expect(rig.posts('link')).toMatchObject([{ by: 'segments', phase: 'open', ending: null }]);
  });

  it('and names none is waited for, and so is one that ends otherwise', () => {
    const { lane: _, ...without } = BYE;
    for (const bye of [without, { ...BYE, lane: '' }, { ...BYE, lane: 7 }, { ...BYE, code: 1012 }]) {
      const rig = inLane(0.5, bye);
      expect(rig.session.phase).toBe('waiting');
      expect(rig.take().some(({ do: what }) => what === 'connect')).toBe(false);
    }
  });

  it('is left from server-sent events, too', () => {
    const rig = new Rig();
    rig.fallBack();
    rig.say(BYE);
    rig.take();
    rig.do(rig.session.closed(rig.now, 1006, 'the answer ended'));
    expect(rig.take()).toContainEqual(LANE);
  });
});

describe('a lane that does not begin', () => {
  it.each(['the address is not one for segments', 'no reader'])(
    'leaves the relay’s own words and its wait: %s',
    (reason) => {
      const rig = inLane();
      rig.take();
      rig.do(rig.session.closed(rig.now, 1006, reason));
      const [link] = rig.posts('link');
      expect(link).toMatchObject({ phase: 'waiting', ending: { code: 1013, reason: 'full' } });
      expect(Object.keys(link?.ending ?? {})).toEqual(['code', 'reason']);
      rig.pass(29_750);
      expect(rig.asked()).toEqual([]);
      rig.pass(31_000);
      expect(rig.asked()[0]).toBe('ws://relay/live?hz=30');
    },
  );
});

describe('in the lane', () => {
  it.each([0, 0.999])(
    'a WebSocket is tried after one to two times what the relay asked for, then ever more seldom',
    (random) => {
      const rig = inLane(random);
      rig.do(rig.session.opened(rig.now));
      rig.take();
      const waits: number[] = [];
      for (let sinceMs = rig.now; waits.length < 7; ) {
        rig.pass(250);
        if (tries(rig).length === 0) continue;
        waits.push(rig.now - sinceMs);
        sinceMs = rig.now;
      }
      const least = [30, 30, 60, 120, 240, 300, 300];
      waits.forEach((ms, i) => {
        expect(ms).toBeGreaterThanOrEqual(1000 * least[i]! * (1 + random) - 250);
        expect(ms).toBeLessThanOrEqual(1000 * least[i]! * (1 + random) + 500);
      });
    },
  );

  it('silence is none of the session’s business, nor are rates, doubts and pings', () => {
    const rig = inLane();
    rig.do(rig.session.opened(rig.now));
    rig.take();
    rig.do(rig.session.visibility(rig.now, false));
    rig.pass(20_000);
    rig.do(rig.session.doubt(rig.now, rig.now - 1000));
    rig.do(rig.session.wake(rig.now));
    rig.do(rig.session.wishAll(rig.now));
    expect(rig.take()).toEqual([]);
    expect(rig.session.phase).toBe('open');
  });

  it('a WebSocket that was let in takes over, and where it ends and is refused the lane runs again', () => {
    const rig = inLane();
    rig.do(rig.session.opened(rig.now));
    rig.pass(60_000);
    rig.take();
    rig.do(rig.session.moved(rig.now));
    expect(rig.posts('link')).toMatchObject([{ by: 'websocket', phase: 'open' }]);
    rig.status();
    rig.pass(1000);
    rig.do(rig.session.closed(rig.now, 1012, ''));
    rig.pass(5250);
    expect(rig.asked()).toEqual(['ws://relay/live?hz=30']);
    rig.do(rig.session.opened(rig.now));
    rig.say(BYE);
    rig.do(rig.session.closed(rig.now, 1013, ''));
    expect(rig.take()).toContainEqual(LANE);
  });

  it('that ends, whyever, a WebSocket is asked for', () => {
    for (const code of [1006, 4403]) {
      const rig = inLane();
      rig.do(rig.session.opened(rig.now));
      rig.take();
      rig.do(rig.session.closed(rig.now, code, 'answered 404'));
      expect(rig.posts('link')).toMatchObject([{ phase: 'waiting', ending: { code: 1006 } }]);
      rig.pass(1000);
      expect(rig.asked()).toEqual(['ws://relay/live?hz=30']);
    }
  });
});

describe('a lane that the page was told', () => {
  const PAST = 'https://cdn.example/api/v1/robots/r/past';
  const begin = (token?: string) => {
    const session = new Session('ws://relay/live', 30, true, () => 0.5, token, PAST);
    return { session, done: session.start(0) };
  };

  it('is read from the beginning, and no socket is tried', () => {
    const { session, done } = begin();
    expect(done).toContainEqual({ do: 'connect', by: 'segments', url: PAST });
    session.opened(100);
    const later = Array.from({ length: 16_000 }, (_, i) => session.tick(100 + 250 * i)).flat();
    expect(later).toEqual([]);
  });

  const addressesOf = (actions: readonly Action[]) =>
    actions.flatMap((action) => (action.do === 'connect' ? [action.url] : []));

  /** The requests while the lane fails and sockets do too; a refused socket names the relay's own lane. */
  function withoutLane(
    random: number,
    ms: number,
    end: (session: Session, nowMs: number, url: string) => Action[],
  ) {
    const session = new Session('ws://relay/live', 30, true, () => random, undefined, PAST);
    const asked: { readonly atMs: number; readonly url: string }[] = [];
    const note = (atMs: number, actions: readonly Action[]): void => {
      for (const url of addressesOf(actions)) {
        asked.push({ atMs, url });
        note(atMs, end(session, atMs, url));
      }
    };
    note(0, session.start(0));
    for (let nowMs = 250; nowMs <= ms; nowMs += 250) note(nowMs, session.tick(nowMs));
    return { session, asked };
  }
  const fail = (session: Session, nowMs: number) => session.closed(nowMs, 1006, 'no answer');
  const hang = () => [];

  it.each([0, 0.4, 0.999])(
    'and fails is asked for again, and then a socket, each page at its own time',
    (random) => {
      for (const end of [fail, hang]) {
        const { asked } = withoutLane(random, 60_000, end);
        const first = asked.find(({ url }) => url !== PAST);
        expect(asked[0]?.url).toBe(PAST);
        expect(first?.url).toBe('ws://relay/live?hz=30');
        expect(first?.atMs).toBeGreaterThanOrEqual(30_000 * random);
        expect(first?.atMs, 'a try of the lane takes 8 s at most').toBeLessThan(30_000 * random + 20_000);
      }
    },
  );

  it('is asked for again where no socket comes either, by whatever way', () => {
    const urls = withoutLane(0.5, 300_000, fail).asked.map(({ url }) => url);
    const turns = urls.filter((url, i) => (url === PAST) !== (urls[i - 1] === PAST));
    expect(turns.length).toBeGreaterThan(5);
    expect(urls).toContain('http://relay/live.sse?hz=30');
  });

  it('and works again is gone on in, and no socket is tried', () => {
    const { asked } = withoutLane(0.999, 120_000, (session, nowMs) =>
      nowMs < 10_000 ? fail(session, nowMs) : session.opened(nowMs),
    );
    expect(new Set(asked.map(({ url }) => url))).toEqual(new Set([PAST]));
  });

  it('and is gone leads to the relay’s own, where the relay is full', () => {
    const { session, asked } = withoutLane(0.5, 60_000, (at, nowMs, url) => {
      if (url === PAST) return fail(at, nowMs);
      at.opened(nowMs);
      if (!url.startsWith('ws:')) return [];
      at.text(nowMs, JSON.stringify(BYE));
      return at.closed(nowMs, 1013, '');
    });
    expect(asked.at(-1)?.url).toBe(LANE.url);
    expect(session.phase).toBe('open');
  });

  it.each(['is full', 'is away'])(
    'and fails: who asks for a try gets all that the page would try, at once, where the relay %s',
    (relay) => {
      const session = new Session('ws://relay/live', 30, true, () => 0.999, undefined, PAST);
      session.start(0);
      session.closed(100, 1006, 'no answer');
      expect(session.phase).toBe('waiting');
      expect(addressesOf(session.wake(150)), 'nobody asked for more than the lane').toEqual([PAST]);
      session.closed(200, 1006, 'no answer');
      expect(addressesOf(session.wake(300, true))).toEqual(['ws://relay/live?hz=30']);
      if (relay === 'is full') {
        session.opened(400);
        session.text(410, JSON.stringify(BYE));
        expect(addressesOf(session.closed(420, 1013, ''))).toEqual([LANE.url]);
        return;
      }
      session.closed(400, 1006, '');
      const next = [500, 750, 1000].map((nowMs) => addressesOf(session.tick(nowMs)));
      expect(next.flat(), 'the lane may be back').toEqual([PAST]);
    },
  );

  it('is not left when it is refused', () => {
    const { session } = begin();
    session.closed(200, 4403, 'not for you');
    expect(session.phase).toBe('ended');
  });

  it('is not for who has a token, and is again without', () => {
    const { session, done } = begin('t');
    expect(done).toContainEqual({ do: 'connect', by: 'websocket', url: 'ws://relay/live?hz=30&auth=1' });
    session.opened(100);
    expect(session.renew(200, undefined)).toContainEqual({ do: 'connect', by: 'segments', url: PAST });
    expect(session.renew(300, 't')).toContainEqual({
      ...{ do: 'connect', by: 'websocket', url: 'ws://relay/live?hz=30&auth=1' },
    });
  });
});

describe('a WebSocket that was tried and refused', () => {
  it.each([0, 0.999])('is tried again when the relay says, however late that is', (random) => {
    const rig = inLane(random);
    rig.do(rig.session.opened(rig.now));
    for (const retryS of [600, 30, 600, 1200]) {
      while (tries(rig).length === 0) rig.pass(250);
      rig.session.refused(rig.now, retryS);
      const sinceMs = rig.now;
      while (tries(rig).length === 0) rig.pass(250);
      const waitedMs = rig.now - sinceMs;
      expect(waitedMs).toBeGreaterThanOrEqual(1000 * retryS * (1 + random));
      expect(waitedMs).toBeLessThanOrEqual(1000 * retryS * (1 + random) + 500);
    }
  });

  it('is not tried sooner than the relay said where the next refusal says nothing', () => {
    const rig = inLane(0, { ...BYE, retry_s: 600 });
    rig.do(rig.session.opened(rig.now));
    rig.take();
    for (let i = 0; i < 3; i++) {
      const sinceMs = rig.now;
      while (tries(rig).length === 0) rig.pass(250);
      expect(rig.now - sinceMs).toBeGreaterThanOrEqual(600_000);
    }
  });
});
