import { describe, expect, it } from 'vitest';
import { Session } from '../src/stream/session.ts';
import { Rig } from './session_rig.ts';

const BYE = { type: 'bye', code: 1013, reason: 'full', retry_s: 30, lane: 'past/public' };
const LANE = { do: 'connect', by: 'segments', url: 'past/public ws://relay/live' };

/** A relay that is full has named its lane, and the lane runs. */
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
        message: { kind: 'link', by: 'segments', phase: 'connecting', retryAtMs: null, ending: null },
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
    const later = Array.from({ length: 4000 }, (_, i) => session.tick(1000 * i)).flat();
    expect(later).toEqual([]);
  });

  it('is asked for again when it fails, and not when it is refused', () => {
    const { session } = begin();
    session.opened(100);
    session.closed(200, 1006, 'no answer');
    const later = Array.from({ length: 40 }, (_, i) => session.tick(1000 * (i + 1))).flat();
    const asked = later.flatMap((action) => (action.do === 'connect' ? [action.url] : []));
    expect(new Set(asked)).toEqual(new Set([PAST]));
    const other = begin().session;
    other.closed(200, 4403, 'not for you');
    expect(other.phase).toBe('ended');
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
