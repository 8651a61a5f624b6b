import { describe, expect, it } from 'vitest';
import { FakeSource, Rig } from '../rigs/past_player_rig.ts';
import { range, recorded, type Sent, sent } from '../rigs/past_recordings.ts';

describe('the newest minute', () => {
  /** A page that has received all frames for a while, 40 ms after the relay and with its own clock. */
  const live = (source: FakeSource, frames: readonly Sent[], clockAheadMs = 40): Rig => {
    const rig = new Rig(source);
    for (const frame of frames) {
      rig.nowMs = frame.atMs + clockAheadMs;
      rig.receive(frame);
    }
    return rig;
  };

  it('shows a pose at once, without a request, also when nothing answers', async () => {
    const rig = live(new FakeSource([]), sent(300));
    rig.source.isAway = true;
    rig.player.skip(-10_000);
    expect(rig.sink.seqs).toEqual([199]);
    await rig.pass(2000);
    expect(rig.sink.seqs).toEqual(range(199, 220));
    expect(rig.source.asked).toEqual([]);
  });

  it('pauses at the newest, and steps from there', async () => {
    const rig = live(new FakeSource([]), sent(300));
    rig.player.toggle();
    expect(rig.sink.seqs).toEqual([299]);
    expect(rig.player.playhead).toMatchObject({ at: 'past', playing: false });
    rig.player.step(-1);
    expect(rig.sink.seqs).toEqual([298]);
    rig.player.step(1);
    rig.player.step(1);
    expect(rig.sink.newest!.seq).toBe(299);
  });

  it('goes over to segments and back, each frame once, whatever the clocks say', async () => {
    for (const aheadMs of [40, -2500, 700, 86_400_000]) {
      const frames = sent(300);
      const rig = live(new FakeSource(recorded(frames.slice(0, 260))), frames, aheadMs);
      rig.player.skip(-12_000);
      expect(rig.sink.seqs).toHaveLength(1);
      await rig.pass(10_000);
      const first = rig.sink.seqs[0]!;
      expect(rig.sink.seqs).toEqual(range(first, rig.sink.newest!.seq + 1));
      expect(rig.sink.newest!.seq).toBeGreaterThan(265);
      expect(rig.player.playhead.momentMs).toBeCloseTo(rig.sink.newest!.atMs, -2.5);
    }
  });

  it('stands in for a segment that does not come', async () => {
    const frames = sent(300);
    const rig = live(new FakeSource(recorded(frames)), frames, 0);
    rig.source.answer = () => new Promise(() => undefined);
    rig.player.skip(-10_000);
    await rig.pass(4000);
    expect(rig.sink.seqs.length).toBeGreaterThan(30);
    expect(rig.sink.seqs).toEqual(range(199, 199 + rig.sink.seqs.length));
  });
});
