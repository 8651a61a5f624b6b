import { expect, it } from 'vitest';
import { type LabelBox, placeApart } from '../../src/app/pages/RowPage.tsx';

const box = (left: number, top: number): LabelBox => ({ left, top, width: 100, height: 40 });
const NOTE = { left: 50, top: 10, width: 200, height: 50 };

it('leaves labels where they are wished, if nothing is in the way', () => {
  expect(placeApart([box(0, 100), box(120, 100)], [NOTE], 400)).toEqual([box(0, 100), box(120, 100)]);
});

it('moves them below notes and each other, however many these are', () => {
  const placed = placeApart([box(60, 20), box(80, 20), box(300, 20)], [NOTE], 400);
  expect(placed).toEqual([box(60, 64), box(80, 108), box(300, 20)]);
});

it('keeps them in the picture', () => {
  expect(placeApart([box(-30, -20), box(380, 90)], [], 400)).toEqual([box(0, 0), box(300, 90)]);
});
