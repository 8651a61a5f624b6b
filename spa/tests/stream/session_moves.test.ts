import { describe, expect, it } from 'vitest';
import { STALE_AFTER_MS } from '../../src/twin/liveness.ts';
import { opened, type Rig } from '../rigs/session_rig.ts';

const BYE = { type: 'bye', code: 1012, reason: 'the relay is being replaced', retry_s: 0.5 };

function sendAway(rig: Rig): void {
  rig.say({ type: 'status', robot: 'online', age_ms: 20, seq: 0 });
  rig.take();
  rig.say(BYE);
  rig.do(rig.session.closed(rig.now, 1012, ''));
}

/** Whether the page is told that it moves, at each change of the connection since the last check. */
const moves = (rig: Rig) => rig.posts('link').map(({ phase, moves }) => [phase, moves]);

describe('a relay that is being replaced', () => {
  it('sends the page on, which is no loss: what was told is not old yet', () => {
    const rig = opened();
    sendAway(rig);
    expect(moves(rig)).toEqual([['waiting', true]]);
    rig.pass(500);
    rig.do(rig.session.opened(rig.now));
    expect(moves(rig)).toEqual([
      ['connecting', true],
      ['open', true],
    ]);
    expect(rig.session.moves).toBe(false);
  });

  it('is asked again by who came too early for its successor, until what was told is old', () => {
    const rig = opened();
    sendAway(rig);
    const before = rig.now;
    const seen: unknown[] = [];
    while (rig.now - before < 2 * STALE_AFTER_MS) {
      rig.pass(50);
      if (rig.session.phase === 'connecting') rig.do(rig.session.closed(rig.now, 1006, ''));
      for (const link of rig.posts('link'))
        if (link.phase === 'waiting') seen.push([rig.now - before < STALE_AFTER_MS, link.moves]);
    }
    expect(seen.length).toBeGreaterThan(2);
    for (const [young, told] of seen as boolean[][]) expect(told).toBe(young);
  });

  it('is a loss where its successor took too long', () => {
    const rig = opened();
    sendAway(rig);
    rig.pass(250);
    expect(rig.session.phase).toBe('connecting');
    rig.pass(STALE_AFTER_MS);
    rig.do(rig.session.opened(rig.now));
    expect(moves(rig).at(-1)).toEqual(['open', false]);
  });

  it('is none of a connection that ended otherwise', () => {
    const rig = opened();
    rig.take();
    rig.do(rig.session.closed(rig.now, 1006, ''));
    expect(moves(rig)).toEqual([['waiting', false]]);
  });
});
