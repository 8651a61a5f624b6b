import { describe, expect, it } from 'vitest';
import { LEAD_FRAMES_MAX } from '../../src/past/player/past_player.ts';
import { FakeSource, Rig } from '../rigs/past_player_rig.ts';
import { FROM_MS, range, recorded, sent } from '../rigs/past_recordings.ts';

const at = (s: number): number => FROM_MS + 1000 * s;

/** The numbers of the states in each lead-in received. */
const leadsOf = ({ sink }: Rig) => sink.leads.map((states) => states.map(({ seq }) => seq));

describe('what led up to a moment at rest', () => {
  it('is told with what is here, and again once the minute before has come, in order and each frame once', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(600))));
    rig.player.openAt(at(30.5));
    await rig.settle();
    const [first] = leadsOf(rig);
    expect(first!.length).toBeGreaterThan(0);
    expect(first).toEqual(range(305 - first!.length, 305));
    const fetched = rig.source.fetched.length;
    rig.player.tick();
    expect(rig.source.fetched, 'it fetches nothing').toHaveLength(fetched);
    expect(rig.sink.leads, 'once, not in every picture').toHaveLength(1);
    await rig.pass(2000);
    expect(leadsOf(rig).slice(1)).toEqual([range(205, 305)]);
  });

  it('is not told while it plays or a finger drags, but when either ends', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(600))));
    rig.player.seek(at(20));
    await rig.pass(3000);
    for (const s of [21, 22, 23]) rig.player.seek(at(s), true);
    await rig.settle();
    expect(rig.sink.leads).toEqual([]);
    rig.player.settle();
    await rig.pass(500);
    expect(rig.sink.leads, 'it plays on').toEqual([]);
    rig.player.toggle();
    const { seq } = rig.sink.newest!;
    expect(leadsOf(rig)).toEqual([range(seq - 100, seq)]);
    for (const s of [30, 31, 32]) rig.player.seek(at(s), true);
    await rig.settle();
    expect(rig.sink.leads).toHaveLength(1);
    rig.player.settle();
    await rig.settle();
    expect(leadsOf(rig).at(-1)!.at(-1)).toBe(319);
  });

  it('goes with each step', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(600))));
    rig.player.openAt(at(20));
    await rig.pass(2000);
    rig.player.step(1);
    expect(leadsOf(rig).at(-1)).toEqual(range(101, 201));
    rig.player.step(-1);
    expect(leadsOf(rig).at(-1)).toEqual(range(100, 200));
  });

  it('is bounded, however often a robot sends', async () => {
    const rig = new Rig(new FakeSource(recorded(sent(2000, { everyMs: 10 }))));
    rig.player.openAt(at(15));
    await rig.pass(2000);
    expect(leadsOf(rig).at(-1)).toEqual(range(1500 - LEAD_FRAMES_MAX, 1500));
  });

  it('leads over from what the page received itself', async () => {
    const rig = new Rig(new FakeSource([]));
    for (const frame of sent(300)) {
      rig.nowMs = frame.atMs + 40;
      rig.receive(frame);
    }
    rig.player.toggle();
    expect(leadsOf(rig)).toEqual([range(199, 299)]);
  });

  it('is of one run', async () => {
    const second = sent(100, { fromMs: at(30) });
    const runs = [
      ...recorded(sent(298)),
      ...recorded(second, { runId: '00000000000000b1', take: '000000000000000b' }),
    ];
    const rig = new Rig(new FakeSource(runs));
    rig.player.openAt(at(32));
    await rig.pass(2000);
    expect(leadsOf(rig).at(-1)).toEqual(range(0, 20));
  });
});
