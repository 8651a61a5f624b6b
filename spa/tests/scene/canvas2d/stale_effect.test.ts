import { expect, it } from 'vitest';
import { pixel } from '../../../src/scene/canvas2d/colors.ts';
import { applyStaleEffect } from '../../../src/scene/canvas2d/painter.ts';

const STALE = [0x98, 0xa2, 0xb3] as const;
const spread = (color: number) => {
  const parts = [color & 255, (color >> 8) & 255, (color >> 16) & 255];
  return Math.max(...parts) - Math.min(...parts);
};

it('takes the colour out, hatches, and leaves what is not drawn', () => {
  const red = pixel(220, 30, 30);
  const pixels = new Uint32Array(18 * 18).fill(red);
  pixels[5] = 0;
  applyStaleEffect(pixels, 18, 1, STALE, 1);
  expect(pixels[5]).toBe(0);
  const drawn = [...pixels].filter((color) => color !== 0);
  expect(Math.max(...drawn.map(spread))).toBeLessThan(20);
  expect(new Set(drawn).size).toBeGreaterThan(1); // stripes: on a grey robot, greying alone would be invisible
  expect(drawn.every((color) => color >>> 24 === 255)).toBe(true);
});

it('comes gradually', () => {
  const after = (amount: number) => {
    const pixels = new Uint32Array(4).fill(pixel(220, 30, 30));
    applyStaleEffect(pixels, 2, amount, STALE, 1);
    return spread(pixels[0]!);
  };
  expect(after(0.5)).toBeLessThan(190);
  expect(after(0.5)).toBeGreaterThan(after(1));
  expect(after(0)).toBeGreaterThan(187);
});
