import fc from 'fast-check';
import { describe, expect, it } from 'vitest';
import type { Speed } from '../../src/past/past_types.ts';
import { FakeSource, Rig } from '../rigs/past_player_rig.ts';
import { FROM_MS, recorded, type Sent, sent } from '../rigs/past_recordings.ts';

const at = (s: number): number => FROM_MS + 1000 * s;

describe('whatever was recorded', () => {
  const lost = fc.uniqueArray(fc.nat({ max: 399 }), { maxLength: 60 });
  const act = fc.record({
    seek: fc.integer({ min: -1, max: 45 }),
    speed: fc.constantFrom<Speed>(0.25, 0.5, 1, 2, 4),
    forMs: fc.integer({ min: 100, max: 6000 }),
    delays: fc.boolean(),
  });

  it('is handed on in order, all of it from the first frame after a jump on, none twice', async () => {
    await fc.assert(
      fc.asyncProperty(
        fc.record({
          lost: fc.tuple(lost, lost),
          takes: fc.integer({ min: 1, max: 2 }),
          overlap: fc.nat({ max: 150 }),
          aheadMs: fc.integer({ min: -400, max: 400 }),
          restartAt: fc.option(fc.integer({ min: 100, max: 300 })),
          acts: fc.array(act, { minLength: 1, maxLength: 4 }),
        }),
        async ({ lost: [lostA, lostB], takes, overlap, aheadMs, restartAt, acts }) => {
          const runs = [
            sent(restartAt ?? 400, { keyEveryS: 1 }),
            restartAt === null ? [] : sent(400 - restartAt, { keyEveryS: 1, fromMs: at(restartAt / 10) }),
          ];
          const segments = runs.flatMap((frames, run) => {
            const runId = `00000000000000b${run}`;
            const hears =
              (missed: readonly number[], from: number, to: number) =>
              ({ seq, atMs }: Sent) => {
                const nth = (atMs - FROM_MS) / 100;
                return nth >= from && nth < to && (!missed.includes(nth) || seq % 10 === 0);
              };
            const half = 200;
            const first = recorded(frames, {
              take: `00000000000000c${run}`,
              runId,
              hears: hears(lostA, 0, takes === 1 ? 400 : half + overlap),
            });
            const second = recorded(frames, {
              ...{ take: `00000000000000d${run}`, runId, aheadMs },
              hears: hears(lostB, half - overlap, 400),
            });
            return takes === 1 ? first : [...first, ...second];
          });
          const kept = runs.flatMap((frames, run) => {
            const runId = `00000000000000b${run}`;
            const seqs = new Set(
              segments
                .filter(({ start }) => start.runId === runId)
                .flatMap(({ records }) =>
                  records.flatMap((each) => (each.kind === 'frame' ? [each.seq] : [])),
                ),
            );
            return frames.filter(({ seq }) => seqs.has(seq)).map(({ codes }) => [run, ...codes].join());
          });
          const rig = new Rig(new FakeSource(segments));
          for (const { seek, speed, forMs, delays } of acts) {
            const waiting: (() => void)[] = [];
            rig.source.answer = () =>
              delays ? new Promise((resolve) => waiting.push(resolve)) : Promise.resolve();
            rig.player.seek(at(seek));
            rig.player.setSpeed(speed);
            for (let left = 2 * forMs; left > 0; left -= 700) {
              await rig.pass(700, 50);
              waiting.splice((left * 7) % Math.max(1, waiting.length), 1)[0]?.(); // not in the order of the requests
            }
            for (const resolve of waiting) resolve();
          }
          for (const states of rig.sink.jumps) {
            const shown = states.map((state) => {
              const { runId } = state as unknown as { runId: string };
              return [Number(runId.at(-1)), ...state.codes].join();
            });
            const first = kept.indexOf(shown[0]!);
            expect(shown).toEqual(shown.length === 0 ? [] : kept.slice(first, first + shown.length));
            expect(states.slice(1).every(({ atMs }, i) => atMs > states[i]!.atMs - 1000)).toBe(true);
          }
        },
      ),
      process.env.POSECAST_FULL === '1' ? { numRuns: 500 } : { numRuns: 40, seed: 1 },
    );
  }, 60_000);
});
