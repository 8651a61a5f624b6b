import { describe, expect, it } from 'vitest';
import { PastError } from '../../src/past/past_source.ts';
import { Coming } from '../../src/past/player/around.ts';
import { FakeSource, Rig } from '../rigs/past_player_rig.ts';
import { FROM_MS, fault, range, recorded, SCHEMA_SHA, schemaOf, sent } from '../rigs/past_recordings.ts';

const at = (s: number): number => FROM_MS + 1000 * s;

describe('PastPlayer', () => {
  it('shows a moment with what was so then, and plays on from there', async () => {
    const happened = [
      { atMs: at(3.05), event: fault(1, at(3.05), 'hot') },
      { atMs: at(7.05), event: fault(2, at(7.05), 'jam') },
      { atMs: at(8.05), event: fault(3, at(8.05), 'jam', 'off') },
    ];
    const rig = new Rig(new FakeSource(recorded(sent(200), { happened })));
    await rig.seek(at(7.58));
    const told = ['schema 2', 'model ab', 'info lab', 'hot on', 'jam on', 'online', '75'];
    expect(rig.sink.since).toEqual(told);
    expect(rig.player.playhead).toMatchObject({ at: 'past', momentMs: at(7.58), playing: true, note: null });
    await rig.pass(1000);
    expect(rig.sink.since).toEqual([
      ...told,
      '76',
      '77',
      '78',
      '79',
      '80',
      'jam off',
      ...range(81, 86).map(String),
    ]);
    expect(rig.sink.newest).toMatchObject({ atMs: at(8.5), lateMs: 5, tS: 58.5 });
    expect([...rig.sink.newest!.codes]).toEqual([85, 85]);
  });

  it('plays through all segments, each frame once, at every speed', async () => {
    for (const speed of [0.25, 0.5, 1, 2, 4] as const) {
      const rig = new Rig(new FakeSource(recorded(sent(300))));
      rig.player.seek(at(1));
      rig.player.setSpeed(speed);
      await rig.pass(20_000 / speed);
      expect(rig.sink.seqs).toEqual(range(10, 211));
    }
  });

  it('shows a first pose at once, and the exact one when its segment has come', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(300))));
    rig.player.attend();
    await rig.settle();
    let come = (): void => undefined;
    rig.source.answer = () => new Promise((resolve) => (come = resolve));
    rig.player.seek(at(5));
    expect(rig.sink.since).toEqual(['schema 2', 'model ab', 'online', '40']);
    await rig.pass(400);
    expect(rig.player.playhead.note).toBe('loading');
    come();
    await rig.settle();
    expect(rig.sink.seqs).toEqual([50]);
    expect(rig.player.playhead).toMatchObject({ note: null, momentMs: at(5) });
  });

  it('hands a new pose for each move of a finger, and asks for nothing', async () => {
    const schema = schemaOf(40);
    const segments = recorded(sent(3600, { schema, everyMs: 500 }));
    const rig = new Rig(new FakeSource(segments, { [SCHEMA_SHA]: schema }));
    rig.player.attend();
    await rig.settle();
    const asked = rig.source.asked.length;
    expect(rig.source.fetched).toEqual([]);
    for (let s = 1790; s > 0; s -= 5) {
      const before = rig.sink.newest;
      rig.player.seek(at(s), true);
      expect(rig.sink.newest).not.toBe(before);
      expect(Math.abs(rig.sink.newest!.atMs - at(s))).toBeLessThanOrEqual(2000);
      expect(rig.player.playhead.momentMs).toBe(at(s));
      await rig.pass(50);
    }
    expect(rig.source.asked.length).toBe(asked);
    rig.player.settle();
    await rig.settle();
    expect(rig.sink.seqs).toEqual([10]);
    expect(rig.source.fetched).toHaveLength(1);
  });

  it('fills the minute before, thinned, and only for the newest jump', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(4000, { everyMs: 30 }))));
    await rig.seek(at(30));
    rig.player.toggle();
    rig.player.seek(at(100));
    await rig.pass(3000);
    expect(rig.sink.fills).toHaveLength(1);
    const [states] = rig.sink.fills;
    expect(states![0]!.atMs).toBe(at(40.02 - 0.03));
    expect(states!.at(-1)!.atMs).toBeGreaterThan(at(99.8));
    expect(states!.slice(1).every(({ atMs }, i) => atMs - states![i]!.atMs >= 100)).toBe(true);
    expect(states!.length).toBeGreaterThan(450);
  });

  it('tells what comes in the half minute after, thinned, and fetches it once and only when asked', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(4000, { everyMs: 30 }))));
    rig.player.openAt(at(60));
    await rig.pass(2000);
    const filled = rig.source.fetched.length;
    const looker = rig.player.extend(Coming);
    const coming = () => (rig.player.frame === null ? [] : looker.after(rig.player.frame));
    for (let i = 0; i < 20; i += 1) {
      coming();
      await rig.pass(500);
    }
    const states = coming();
    expect(states[0]!.atMs).toBeGreaterThan(at(60));
    expect(states[0]!.atMs).toBeLessThan(at(60.2));
    expect(states.at(-1)!.atMs).toBeGreaterThan(at(89.8));
    expect(states.at(-1)!.atMs).toBeLessThanOrEqual(at(90));
    expect(states.slice(1).every(({ atMs }, i) => atMs - states[i]!.atMs >= 100)).toBe(true);
    const { fetched } = rig.source;
    expect(new Set(fetched).size).toBe(fetched.length);
    const segments = rig.source.segmentsIn({ fromMs: at(60), toMs: at(90) }).length;
    expect(fetched.length - filled).toBeLessThanOrEqual(segments);
    expect(rig.sink.seqs, 'nothing of it is shown').toHaveLength(1);
    rig.player.goLive();
    expect(coming()).toEqual([]);
  });

  it('tells what somebody would have been told who came then: of the ten minutes before, also what is over', async () => {
    const happened = [
      { atMs: at(3.05), event: fault(2, at(3.05), 'jam') },
      { atMs: at(4.05), event: fault(3, at(4.05), 'jam', 'off') },
      { atMs: at(9.05), event: fault(4, at(9.05), 'hot') },
    ];
    const rig = new Rig(new FakeSource(recorded(sent(200), { happened })));
    rig.heard = [
      fault(0, at(-700), 'long ago'),
      fault(1, at(-300), 'before'),
      ...happened.map((each) => each.event),
    ];
    await rig.seek(at(7.58));
    const told = ['schema 2', 'model ab', 'info lab', 'before on', 'jam on', 'jam off', 'online'];
    expect(rig.sink.since).toEqual([...told, '75']);
    await rig.pass(2000);
    expect(rig.sink.since.filter((each) => / o(n|ff)$/.test(each))).toEqual([...told.slice(3, 6), 'hot on']);
  });

  it('plays and jumps across the moment at which a robot gets another channel', async () => {
    const [more, sha] = [schemaOf(3), '6d'.repeat(32)];
    const before = recorded(sent(100));
    const grown = sent(100, { schema: more, firstSeq: 100, fromMs: at(10) });
    const after = recorded(grown, { schemaSha: sha, firstIndex: before.length });
    const rig = new Rig(new FakeSource([...before, ...after], { [SCHEMA_SHA]: schemaOf(2), [sha]: more }));
    rig.player.seek(at(8));
    await rig.pass(4000);
    expect(rig.sink.seqs).toEqual(range(80, 121));
    expect(rig.sink.newest!.codes).toHaveLength(3);
    await rig.seek(at(5));
    expect(rig.sink.newest!.codes).toHaveLength(2);
    const told = rig.sink.since.filter((each) => each.startsWith('schema'));
    expect(told.at(-1)).toBe('schema 2');
  });

  it('steps frame by frame, also across segments', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(300))));
    await rig.seek(at(4.05));
    for (const [by, seq] of [
      [1, 41],
      [-1, 40],
      [-1, 39],
      [-1, 38],
      [1, 39],
      [1, 40],
      [1, 41],
    ] as const) {
      rig.player.step(by);
      await rig.settle();
      expect(rig.sink.newest!.seq).toBe(seq);
      expect(rig.player.playhead).toMatchObject({ playing: false, momentMs: at(seq / 10) });
    }
    rig.player.seek(at(0));
    rig.player.step(-1);
    await rig.settle();
    expect(rig.sink.newest!.seq).toBe(0);
  });

  it('plays a span again and again', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(300))));
    rig.player.setLoop({ fromMs: at(3), toMs: at(4) });
    expect(rig.player.playhead).toMatchObject({ at: 'past', loop: { fromMs: at(3), toMs: at(4) } });
    await rig.pass(3500);
    expect(rig.sink.jumps.map((states) => states.map(({ seq }) => seq))).toEqual([
      ...new Array(3).fill(range(30, 41)),
      range(30, rig.sink.newest!.seq + 1),
    ]);
    rig.player.seek(at(10));
    expect(rig.player.playhead.loop).toBeNull();
  });

  it('goes to two seconds before the next or previous fault, exactly', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(1000))));
    const mark = (s: number, exact = true) =>
      ({ atMs: at(s), level: 'fault', source: 'LKN', text: 'hot', exact }) as const;
    rig.source.draw([mark(20), { ...mark(30), level: 'caution' }, mark(40, false), mark(80)]);
    rig.source.answerIndex = async () => rig.source.draw([mark(20), mark(45), mark(80)]);
    rig.player.seek(at(10));
    rig.player.toggle();
    const visited: number[] = [];
    for (const by of [1, 1, 1, 1, -1, -1, -1] as const) {
      await rig.visitFault(by);
      visited.push((rig.player.playhead.momentMs - FROM_MS) / 1000);
    }
    expect(visited).toEqual([18, 43, 78, 78, 43, 18, 18]);
  });

  it('takes faults of one event for one, and goes on from it at a second press, however far it has played', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(1000))));
    const mark = (s: number) =>
      ({ atMs: at(s), level: 'fault', source: 'LKN', text: 'hot', exact: true }) as const;
    rig.source.draw([mark(20), mark(40), mark(41.5), mark(80)]);
    rig.player.seek(at(90));
    rig.player.visitFault(-1);
    await rig.pass(2500);
    await rig.visitFault(-1);
    expect(rig.player.playhead.momentMs).toBe(at(38));
    await rig.pass(2500);
    await rig.visitFault(1);
    expect(rig.player.playhead.momentMs, 'past the second of the event').toBe(at(78));
    await rig.pass(3500);
    await rig.visitFault(-1);
    expect(rig.player.playhead.momentMs, 'a while later it is seen again').toBe(at(78));
    await rig.pass(500);
    rig.player.skip(-1000);
    await rig.pass(100);
    await rig.visitFault(-1);
    expect(rig.player.playhead.momentMs, 'from elsewhere').toBe(at(38));
  });

  it('tells the words of a gap at their moments, and skips what is left of it after 2 s', async () => {
    const frames = sent(100).concat(sent(100, { firstSeq: 100, fromMs: at(300) }));
    const happened = [
      { atMs: at(11), word: 'silent' },
      { atMs: at(21), word: 'offline' },
      { atMs: at(300), word: 'online' },
    ] as const;
    const rig = new Rig(new FakeSource(recorded(frames, { happened })));
    rig.player.seek(at(9.5));
    await rig.pass(1400);
    expect(rig.sink.since.at(-1)).toBe('99');
    await rig.pass(200);
    expect(rig.sink.since.at(-1)).toBe('silent');
    expect(rig.player.playhead.momentMs).toBeLessThan(at(11.2));
    await rig.pass(2200);
    expect(rig.sink.since.at(-1)).toBe('offline');
    await rig.pass(4000);
    expect(rig.sink.since).toContain('online');
    expect(rig.sink.seqs).toEqual(range(95, rig.sink.newest!.seq + 1));
    expect(rig.sink.newest!.seq).toBeGreaterThan(100);
    await rig.seek(at(200));
    expect(rig.sink.since.slice(-2)).toEqual(['offline', '99']);
    expect(rig.player.playhead.momentMs).toBe(at(200));
  });

  it('rests while the relay is away, tries every 2 s, and goes on', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(300))));
    rig.player.seek(at(1));
    await rig.pass(1000);
    rig.source.isAway = true;
    await rig.pass(8000);
    const rested = rig.player.playhead;
    expect(rested).toMatchObject({ note: 'away', playing: true });
    const tries = rig.source.fetched.length;
    await rig.pass(10_000);
    expect(rig.source.fetched.length - tries).toBeLessThanOrEqual(3 * 5);
    expect(rig.player.playhead.momentMs).toBe(rested.momentMs);
    rig.source.isAway = false;
    await rig.pass(4000);
    expect(rig.player.playhead.note).toBeNull();
    expect(rig.sink.seqs).toEqual(range(10, rig.sink.newest!.seq + 1));
    expect(rig.sink.newest!.atMs).toBeGreaterThan(rested.momentMs);
  });

  it('passes over what is damaged, and says so', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(300))));
    rig.source.answer = async ({ index }) => {
      if (index === 2) throw new PastError('damaged', 'hash');
    };
    rig.player.seek(at(3));
    await rig.pass(1500);
    expect(rig.player.playhead.note).toBe('damaged');
    await rig.pass(3000);
    expect(rig.sink.seqs).toEqual([...range(30, 40), ...range(60, rig.sink.newest!.seq + 1)]);
    await rig.seek(at(5));
    expect(rig.sink.seqs).toEqual([39]);
    expect(rig.player.playhead.note).toBe('damaged');
  });

  it('goes on at the oldest when its moment has left the window, and says so', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(600))));
    rig.player.seek(at(3));
    rig.player.toggle();
    await rig.pass(100);
    rig.source.dropBefore(at(30));
    rig.player.toggle();
    await rig.pass(9000);
    expect(rig.sink.jumps).toHaveLength(2);
    expect(rig.sink.seqs).toEqual(range(300, rig.sink.newest!.seq + 1));
    rig.source.dropBefore(at(50));
    await rig.seek(at(20));
    expect(rig.player.playhead.momentMs).toBe(at(50));
  });

  it('shows no more of what was deleted: neither pose nor faults, and says so', async () => {
    const happened = [
      { atMs: at(5.05), event: fault(1, at(5.05), 'jam') },
      { atMs: at(5.45), event: fault(2, at(5.45), 'jam', 'off') },
    ];
    const rig = new Rig(new FakeSource(recorded(sent(900), { happened })));
    await rig.seek(at(50));
    expect(rig.sink.since).toContain('jam on');
    await rig.seek(at(20));
    expect(rig.sink.seqs).toEqual([200]);
    rig.source.delete({ fromMs: at(4), toMs: at(40) });
    await rig.settle();
    expect(rig.player.playhead).toMatchObject({ at: 'past', playing: false, note: 'not-kept' });
    const shownMs = rig.sink.newest!.atMs;
    expect(shownMs < at(4) || shownMs >= at(40), `${(shownMs - at(0)) / 1000} s`).toBe(true);
    await rig.seek(at(60));
    expect(rig.sink.seqs).toEqual([600]);
    expect(rig.sink.since).not.toContain('jam on');
    rig.source.delete({ fromMs: at(70), toMs: at(71) });
    await rig.settle();
    expect(rig.player.playhead).toMatchObject({ at: 'past', momentMs: at(60), note: null });
  });

  it('leaves the past when all of it was deleted', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(300))));
    await rig.seek(at(6));
    rig.source.delete({ fromMs: 0, toMs: at(60) });
    expect(rig.player.playhead.at).toBe('live');
  });

  it('asks for no picture while it is paused and nothing is awaited, and for some again at a step', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(300))));
    rig.player.seek(FROM_MS + 12_000);
    await rig.pass(1000);
    rig.player.toggle();
    await rig.pass(500);
    expect(rig.player.isResting).toBe(true);
    const { ticks } = rig;
    await rig.pass(60_000);
    expect(rig.ticks).toBe(ticks);
    const before = rig.sink.newest!.seq;
    rig.player.step(1);
    await rig.pass(500);
    expect(rig.sink.newest!.seq).toBe(before + 1);
    rig.player.toggle();
    await rig.pass(1000);
    expect(rig.ticks).toBeGreaterThan(ticks + 10);
  });

  it('opens at a moment that a link names, and rests there', async () => {
    const rig = new Rig(new FakeSource([]));
    rig.player.openAt(at(12.34));
    await rig.pass(500);
    expect(rig.player.playhead).toMatchObject({ playing: false, note: 'loading' });
    rig.source.add(recorded(sent(300)));
    await rig.settle();
    expect(rig.sink.seqs).toEqual([123]);
    expect(rig.player.playhead).toMatchObject({
      at: 'past',
      playing: false,
      note: null,
      momentMs: at(12.34),
    });
    rig.player.openAt(at(-500));
    await rig.settle();
    expect(rig.player.playhead).toMatchObject({ momentMs: at(0), note: 'not-kept' });
    rig.source.add(recorded(sent(10, { firstSeq: 400, fromMs: at(100) }), { take: '000000000000000b' }));
    rig.player.openAt(at(70));
    await rig.settle();
    expect(rig.player.playhead).toMatchObject({ momentMs: at(100), note: 'not-kept', askedMs: at(70) });
    rig.player.skip(1000);
    expect(rig.player.playhead).toMatchObject({ note: null, askedMs: null });
  });

  it('is live where a link names a moment to come, and says so for a while', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(300))));
    rig.player.openAt(rig.nowMs + 60_000);
    await rig.settle();
    const asked = { askedMs: rig.nowMs + 60_000 };
    expect(rig.player.playhead).toMatchObject({ at: 'live', note: 'not-come', ...asked });
    await rig.pass(14_000, 500);
    expect(rig.player.playhead.note).toBe('not-come');
    await rig.pass(1100, 500);
    expect(rig.player.playhead.note).toBeNull();
  });

  it('becomes live when nothing is left, at once when it is faster', async () => {
    for (const [speed, ms] of [
      [1, 2000],
      [4, 300],
    ] as const) {
      const rig = new Rig(new FakeSource(recorded(sent(300))));
      rig.player.seek(at(28));
      rig.player.setSpeed(speed);
      await rig.pass(1900 / speed);
      expect(rig.player.playhead.at).toBe('past');
      await rig.pass(ms + 200);
      expect(rig.player.playhead).toMatchObject({ at: 'live', momentMs: at(29.9), speed: 1, playing: true });
      expect(rig.sink.seqs).toEqual(range(280, 300));
    }
  });

  it('tells of changes at once, of moments ten times a second', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(300))));
    let calls = 0;
    rig.player.onChange(() => {
      calls += 1;
    });
    rig.player.seek(at(1));
    expect(calls).toBe(1);
    await rig.settle();
    calls = 0;
    await rig.pass(5000, 20);
    expect(calls).toBeGreaterThanOrEqual(49);
    expect(calls).toBeLessThanOrEqual(50);
    for (const change of [
      () => rig.player.setSpeed(2),
      () => rig.player.toggle(),
      () => rig.player.setLoop({ fromMs: at(1), toMs: at(20) }),
      () => rig.player.goLive(),
    ]) {
      const before = rig.player.playhead;
      calls = 0;
      change();
      expect(calls).toBe(1);
      expect(rig.player.playhead).not.toBe(before);
    }
  });

  it('asks for the next segments early, more at four times the speed', async () => {
    for (const [speed, count] of [
      [1, 4],
      [4, 8],
    ] as const) {
      const rig = new Rig(new FakeSource(recorded(sent(300))));
      rig.player.seek(at(6.5));
      rig.player.setSpeed(speed);
      await rig.pass(100);
      expect(rig.source.fetched).toHaveLength(count);
    }
  });
});
