import { expect, it } from 'vitest';
import { AdaptiveResolution } from '../../../src/scene/canvas2d/view.ts';

it('draws motion with as many pixels as there is time for, and what rests finely', () => {
  const sharpness = new AdaptiveResolution();
  expect(sharpness.ratio(1, false)).toBe(1);
  expect(sharpness.ratio(1, true)).toBe(2);
  for (let i = 0; i < 20; i += 1) sharpness.took(i % 4 === 3 ? 60 : 15); // an occasional outlier
  expect(sharpness.ratio(1, false)).toBe(1);
  for (let i = 0; i < 4; i += 1) sharpness.took(60);
  expect([sharpness.ratio(1, false), sharpness.reduced]).toEqual([0.75, true]);
  for (let i = 0; i < 30; i += 1) sharpness.took(60);
  expect(sharpness.ratio(2, false)).toBe(0.5);
  for (let i = 0; i < 200; i += 1) sharpness.took(15); // neither slow nor fast
  expect(sharpness.ratio(1, false)).toBe(0.5);
  for (let i = 0; i < 60; i += 1) sharpness.took(3);
  expect([sharpness.ratio(1, false), sharpness.reduced]).toEqual([1, false]);
  for (let i = 0; i < 600; i += 1) sharpness.took(3);
  expect(sharpness.ratio(1, false)).toBe(2);
});
