import { expect, test } from 'vitest';
import { Silence } from './lateness.ts';

test('what comes after a silence is as old as the silence until something ends it', () => {
  const silence = new Silence();
  expect(silence.ageMs(5000)).toBe(0);
  silence.begin(1000);
  silence.begin(4000);
  expect(silence.ageMs(5000)).toBe(4000);
  silence.end();
  expect(silence.ageMs(6000)).toBe(0);
});

test('only what was written after the pose was called old ends it', () => {
  const silence = new Silence();
  silence.begin(1000);
  silence.endIfWrittenAfter(3000, 2000);
  expect(silence.ageMs(5000)).toBe(4000);
  silence.endIfWrittenAfter(3001, 2000);
  expect(silence.ageMs(5000)).toBe(0);
});
