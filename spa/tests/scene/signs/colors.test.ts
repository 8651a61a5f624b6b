import { expect, it } from 'vitest';
import { levelColor, OVERLAY_COLORS } from '../../../src/scene/signs/colors.ts';

it('signs are grey when the picture is old, and have other colours for colour-blind eyes', () => {
  const { dark, light } = OVERLAY_COLORS;
  expect(levelColor(dark, 'standard', 'fault', false)).toBe(dark.stale);
  expect(levelColor(dark, 'standard', 'fault', true)).toBe(dark.fault);
  expect(levelColor(dark, 'safe', 'caution', true)).toBe(0xf0e442);
  expect(levelColor(light, 'safe', 'caution', true)).toBe(0xe69f00);
});
