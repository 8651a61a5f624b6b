import { expect, it } from 'vitest';
import { edgeWords } from '../src/app/status/edge_words.ts';
import { moreEn } from '../src/app/text/more_en.ts';

it('what an agent reports about its source is said from the catalogue, a robot’s own words as they are', () => {
  const tooLarge = "robot's samples are too large";
  expect(moreEn.agentTooLarge, 'the agent’s own words').toBe(tooLarge);
  expect(edgeWords('source', tooLarge)).toBe(moreEn.agentTooLarge);
  expect(edgeWords('source', 'silent')).toBe(moreEn.agentSilent);
  expect(edgeWords('events', '12 more')).toBe(moreEn.moreEvents('12'));
  expect(edgeWords('source', 'on fire')).toBe('on fire');
  expect(edgeWords('RKN', 'silent')).toBe('silent');
});
