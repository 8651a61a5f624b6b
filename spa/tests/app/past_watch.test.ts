import { expect, it, vi } from 'vitest';
import { PastWatch } from '../../src/app/past/past_watch.ts';
import { stageWords } from '../../src/app/words/status.ts';
import type { PastNote } from '../../src/past/past_types.ts';
import type { Link } from '../../src/stream/client.ts';
import { isOld } from '../../src/twin/liveness.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { codesWith, SCHEMA } from '../rigs/schema.ts';

const PLAYHEAD = { at: 'past', playing: true, speed: 1, loop: null } as const;

/** The watch of a robot whose poses have assigned moments. */
function watched() {
  const twin = new RobotTwin('demo', 0);
  twin.acceptSchema(SCHEMA);
  const at = {
    moment: 100_000,
    now: 500_000,
    note: null as PastNote | null,
    told: null as number | null,
    live: false,
  };
  const watch = new PastWatch(
    twin,
    () => at.moment,
    () => ({
      ...{ nowMs: at.now },
      playhead: {
        ...PLAYHEAD,
        at: at.live ? 'live' : 'past',
        momentMs: at.told ?? at.moment,
        note: at.note,
        askedMs: 7000,
        recorded: null,
      },
    }),
  );
  const heard = vi.fn(() => isOld(watch.verdict()));
  watch.onWord(heard);
  let seq = 0;
  const pose = (atMs: number) => {
    seq += 1;
    const known = { schemaId: SCHEMA.id, seq, tS: seq, codes: codesWith({}), freshMs: null, bornMs: null };
    twin.acceptState({ ...known, changedMs: atMs, atMs });
    watch.look();
  };
  return { at, watch, heard, pose };
}

it('says PAST, how long ago, and never that it is live', () => {
  const { at, watch, pose } = watched();
  pose(99_990);
  expect(watch.word).toBe('PAST');
  expect(watch.verdict()).toMatchObject({ word: 'PAST', cause: null, ageMs: 400_000 });
  at.moment = 530_000;
  expect(watch.verdict().ageMs, 'the two clocks are not known better than that').toBe(0);
});

it('tells when the pose of the moment comes, and when another moment is wanted', () => {
  const { at, watch, heard, pose } = watched();
  expect(isOld(watch.verdict())).toBe(true);
  pose(98_000);
  expect(heard).toHaveBeenCalledTimes(1);
  expect(heard).toHaveLastReturnedWith(false);
  pose(98_033);
  expect(heard).toHaveBeenCalledTimes(1);
  at.moment = 300_000;
  watch.look();
  expect(heard).toHaveBeenCalledTimes(2);
  expect(heard).toHaveLastReturnedWith(true);
  expect(watch.verdict().past).toMatchObject({
    momentMs: 300_000,
    askedMs: null,
    was: null,
    isHere: false,
    recorded: null,
  });
});

it('the last pose of a robot that was silent then is that of the moment, and old', () => {
  const { watch, pose } = watched();
  pose(60_000);
  watch.was('silent');
  expect(watch.verdict().past).toMatchObject({
    momentMs: 100_000,
    askedMs: null,
    was: 'STALE',
    isHere: true,
    recorded: null,
  });
  expect(isOld(watch.verdict())).toBe(true);
  watch.was('offline');
  expect(watch.verdict().past?.was).toBe('OFFLINE');
  watch.was('online');
  expect(watch.verdict().past).toMatchObject({ was: null, isHere: false, recorded: null });
});

it('names the moment that a link asked for, if that is not kept', () => {
  const { at, watch } = watched();
  at.note = 'not-kept';
  expect(watch.verdict().past?.askedMs).toBe(7000);
  const words = stageWords(watch.verdict(), {} as Link, at.now);
  expect(words).toMatch(/^The past: 1 Jan .*:07 is no longer kept; this is the oldest moment, .* ago\.$/);
});

it('tells the moment and the age that the time line tells', () => {
  const { at, watch } = watched();
  at.told = 99_950;
  expect(watch.verdict()).toMatchObject({ ageMs: 400_050, past: { momentMs: 99_950 } });
});

it('on the way back to live it is still of the moment whose pose is shown', () => {
  const { at, watch, pose } = watched();
  pose(99_990);
  at.live = true;
  at.told = 499_000;
  expect(watch.verdict()).toMatchObject({ ageMs: 400_000, past: { momentMs: 100_000, isHere: true } });
});
