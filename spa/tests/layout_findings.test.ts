import { expect, it } from 'vitest';
import { type Box, findWrong, type Shown } from '../e2e/layout/findings.ts';

const box = (left: number, top: number, right: number, bottom: number): Box => ({ left, top, right, bottom });

/** A text of one line, the element with this number, whole unless stated otherwise. */
function text(name: string, number: number, at: Box, other: Partial<Shown> = {}): Shown {
  return {
    ...{ kind: 'text' as const, name, from: number, to: number, whole: [at], seen: [at], reachable: false },
    ...other,
  };
}

it('names two texts that lie over each other once, and none that touch', () => {
  const note = text('note', 1, box(0, 0, 100, 20));
  expect(findWrong([note, text('roll', 2, box(90, 10, 150, 30))])).toEqual([
    'over each other: note and roll',
  ]);
  expect(findWrong([note, text('roll', 2, box(100, 0, 150, 20))])).toEqual([]);
  expect(findWrong([note, text('roll', 2, box(0, 19, 100, 40))]), 'a rounded pixel').toEqual([]);
});

it('does not mind what stands in what contains it, nor grounds over grounds', () => {
  const card = text('card', 1, box(0, 0, 100, 100), { kind: 'ground', to: 9 });
  const inside = text('words', 5, box(10, 10, 50, 30));
  const beside = text('other card', 12, box(50, 50, 150, 150), { kind: 'ground' });
  expect(findWrong([card, inside, beside])).toEqual([]);
  expect(findWrong([card, text('far words', 12, box(60, 60, 90, 80))])).toEqual([
    'over each other: card and far words',
  ]);
});

it('looks at each line of a text', () => {
  const lines = [box(50, 0, 100, 20), box(0, 20, 30, 40)];
  const broken = text('broken', 1, lines[0]!, { whole: lines, seen: lines });
  expect(findWrong([broken, text('before it', 2, box(0, 0, 50, 20))])).toEqual([]);
  expect(findWrong([broken, text('below it', 3, box(0, 25, 20, 35))])).toEqual([
    'over each other: below it and broken',
  ]);
});

it('names what is cut, unless it can be read whole elsewhere', () => {
  const seen = [box(0, 0, 60, 20)];
  const cut = text('STALE 4.2 s', 1, box(0, 0, 100, 20), { seen });
  expect(findWrong([cut])).toEqual(['cut: STALE 4.2 s']);
  expect(findWrong([{ ...cut, reachable: true }])).toEqual([]);
  expect(findWrong([{ ...cut, seen: [box(0, 0, 0, 0)] }]), 'hidden as a whole').toEqual(['cut: STALE 4.2 s']);
});

it('looks at a control as one, and names what takes its taps', () => {
  const button = text('button', 1, box(0, 0, 50, 30), { kind: 'control', to: 2, takenBy: 'sheet' });
  const label = text('Try now', 2, box(5, 5, 45, 25));
  const note = text('note', 3, box(40, 0, 90, 30));
  expect(findWrong([button, label, note])).toEqual([
    'out of reach under sheet: button',
    'over each other: button and note',
  ]);
});
