import { expect, it } from 'vitest';
import { layOutRow } from '../../../src/scene/figure/robot_row.ts';

/** A robot of this width and height; records where it was placed. */
function robot(width: number, height: number, there = true) {
  const made = {
    at: 0,
    width,
    size: there ? ([0.4, width, height] as const) : null,
    standAside: (y: number) => {
      made.at = y;
    },
  };
  return made;
}

it('robots stand side by side in their order, none in another, their middle at the origin', () => {
  const line = [robot(0.8, 1.3), robot(0, 0, false), robot(2, 0.5), robot(0.1, 1.8)];
  for (let again = 0; again < 2; again += 1) {
    layOutRow(line);
    for (const [i, { at, width }] of line.entries()) {
      const next = line[i + 1];
      if (next === undefined) continue;
      expect(next.at).toBeGreaterThan(at);
      expect(next.at - next.width / 2).toBeGreaterThanOrEqual(at + width / 2);
    }
  }
  const [first] = line;
  expect(first!.at).toBeLessThan(0);
  expect(line.at(-1)!.at).toBeGreaterThan(0);
});
