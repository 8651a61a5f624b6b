import { expect, it } from 'vitest';
import { QUIET_AFTER_MS, STALE_AFTER_MS } from '../../src/twin/liveness.ts';
import { opened, Rig } from '../rigs/session_rig.ts';

/** What was shown since the last check, and when each pose counts as new. */
const born = (rig: Rig) =>
  rig.posts('state').map(({ state: { seq, bornMs } }) => [seq, bornMs && Math.ceil(bornMs)]); // up to 1 ms of drift
const pings = (rig: Rig) =>
  rig.sent().flatMap((message) => {
    const { type, t } = message as { type: string; t: number };
    return type === 'ping' ? [t] : [];
  });

it('after a silence what comes counts as of before it, until the relay has answered', () => {
  const rig = opened();
  rig.next();
  const heardMs = rig.now;
  rig.take();
  rig.now += STALE_AFTER_MS + 1;
  rig.next();
  const [askedMs] = pings(rig);
  expect(askedMs).toBe(rig.now);
  rig.now += 20;
  rig.next();
  expect(born(rig)).toEqual([[3, heardMs]]);
  rig.status({ seq: 3, age_ms: 5 });
  expect(rig.posts('status')).toMatchObject([{ status: { atMs: heardMs } }]);
  rig.pong(askedMs);
  rig.next();
  expect(born(rig)).toEqual([[4, rig.now]]);
});

it('an answer to an earlier question proves nothing: it lay before all that was on its way', () => {
  const rig = opened();
  rig.next();
  rig.pass(250);
  const [before] = pings(rig);
  const heardMs = rig.now - 250;
  rig.now += STALE_AFTER_MS;
  rig.pong(before);
  rig.next();
  expect(born(rig)).toEqual([[2, heardMs]]);
});

it('a pause that the page calls LIVE is no silence', () => {
  const rig = opened();
  rig.next();
  rig.take();
  rig.now += STALE_AFTER_MS;
  rig.next();
  expect(born(rig)).toEqual([[2, rig.now]]);
});

it('once the page has called its pose old, also what comes after a shorter pause counts so until then', () => {
  const rig = opened();
  rig.next();
  const heardMs = rig.now;
  rig.now += STALE_AFTER_MS - 100;
  rig.take();
  rig.do(rig.session.doubt(rig.now, rig.now));
  const [askedMs] = pings(rig);
  expect(askedMs).toBe(rig.now);
  rig.now += 20;
  rig.next();
  expect(born(rig)).toEqual([[2, heardMs]]);
  rig.pong(askedMs);
  rig.next();
  expect(born(rig)).toEqual([[3, rig.now]]);
});

it('what came while the page’s word was on its way to the stream makes nothing younger', () => {
  const rig = opened();
  rig.next();
  const calledOldMs = rig.now;
  rig.now += 5;
  rig.next();
  rig.do(rig.session.doubt(rig.now, calledOldMs));
  rig.take();
  rig.now += 20;
  rig.next();
  expect(born(rig)).toEqual([[3, calledOldMs]]);
});

it('events tell their delay themselves: nothing is asked and nothing doubted', () => {
  const rig = new Rig();
  rig.fallBack();
  rig.take();
  rig.do(rig.session.doubt(rig.now, rig.now));
  expect(rig.take()).toEqual([]);
});

it('a hidden page hears less often', () => {
  const rig = opened();
  rig.do(rig.session.visibility(rig.now, false));
  rig.take();
  rig.now += QUIET_AFTER_MS;
  rig.status();
  expect(pings(rig)).toEqual([]);
  rig.now += QUIET_AFTER_MS + 1;
  rig.status();
  expect(pings(rig)).toEqual([rig.now]);
});

it('what a thread that stood still finds of its new connection is of any age', () => {
  const rig = new Rig();
  rig.do(rig.session.start(rig.now));
  const aliveMs = rig.now;
  rig.take();
  rig.now += 60_000;
  rig.do(rig.session.opened(rig.now));
  rig.status({ seq: 1 });
  rig.schema();
  const [askedMs] = pings(rig);
  expect(askedMs).toBe(rig.now);
  rig.next();
  rig.next();
  expect(born(rig)).toEqual([
    [1, aliveMs - 20],
    [2, aliveMs],
  ]);
});

it('on events, where nothing can be asked, it connects anew', () => {
  const rig = new Rig();
  rig.do(rig.session.start(rig.now));
  for (let failure = 0; failure < 2; failure++) {
    rig.do(rig.session.closed(rig.now, 1006, ''));
    rig.pass(1000);
  }
  rig.take();
  rig.now += 60_000;
  rig.do(rig.session.opened(rig.now));
  expect(rig.session.phase).toBe('connecting');
  expect(rig.asked()).toHaveLength(1);
});

it('the first pose after a time without may be of any moment since the newest status', () => {
  const rig = opened();
  rig.next();
  rig.do(rig.session.visibility(rig.now, false));
  rig.now += 900;
  rig.do(rig.session.visibility(rig.now, true));
  rig.take();
  rig.next();
  expect(born(rig)).toEqual([[2, null]]);
  rig.next();
  expect(born(rig)).toEqual([[3, rig.now]]);
});

it('a KEY that is older than the newest is there to be built upon, and never shown', () => {
  const rig = new Rig();
  rig.open();
  rig.status({ seq: 3 });
  rig.schema();
  for (let n = 1; n <= 4; n++) rig.next({ 'pos.RKN': n }, n <= 2);
  expect(rig.posts('state').map(({ state }) => state.seq)).toEqual([3, 4]);
});
