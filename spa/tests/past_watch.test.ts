import { expect, it, vi } from 'vitest';
import { PastWatch } from '../src/app/past/past_watch.ts';
import { isOld } from '../src/twin/liveness.ts';
import { RobotTwin } from '../src/twin/robot.ts';
import { codesWith, SCHEMA } from './schema.ts';

/** The watch of a robot whose poses are given their moments. */
function watched() {
  const twin = new RobotTwin('demo', 0);
  twin.acceptSchema(SCHEMA);
  const at = { moment: 100_000, now: 500_000 };
  const watch = new PastWatch(
    twin,
    () => at.moment,
    () => at.now,
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
  watch.newest(420_000); // the relay's clock is 80 s behind the page's
  expect(watch.verdict().ageMs).toBe(320_000);
  at.moment = 430_000;
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
  expect(watch.verdict().past).toEqual({ momentMs: 300_000, was: null, isHere: false });
});

it('the last pose of a robot that was silent then is that of the moment, and old', () => {
  const { watch, pose } = watched();
  pose(60_000);
  watch.was('silent');
  expect(watch.verdict().past).toEqual({ momentMs: 100_000, was: 'STALE', isHere: true });
  expect(isOld(watch.verdict())).toBe(true);
  watch.was('offline');
  expect(watch.verdict().past?.was).toBe('OFFLINE');
  watch.was('online');
  expect(watch.verdict().past).toMatchObject({ was: null, isHere: false });
});
