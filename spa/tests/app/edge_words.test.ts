import { afterEach, expect, it, vi } from 'vitest';
import { edgeWords } from '../../src/app/words/fault.ts';

const language = vi.hoisted(() => ({ korean: null as unknown }));
vi.mock('../../src/app/text/language.ts', () => ({ korean: () => language.korean }));
afterEach(() => {
  language.korean = null;
});

const TOO_LARGE = "robot's samples are too large"; // the text in posecast_edge/sources/jsonl.py

it('what an agent reports about its source is translated, a robot’s own words are not', async () => {
  expect(edgeWords('source', TOO_LARGE)).toBe(TOO_LARGE);
  language.korean = await import('../../src/app/text/ko.ts');
  for (const [source, words] of [
    ['source', TOO_LARGE],
    ['source', 'silent'],
    ['events', '12 more'],
  ] as const)
    expect(edgeWords(source, words), words).toMatch(/^[^a-z]+$/);
  expect(edgeWords('events', '12 more')).toContain('12');
  expect(edgeWords('source', 'on fire')).toBe('on fire');
  expect(edgeWords('RKN', 'silent')).toBe('silent');
});
