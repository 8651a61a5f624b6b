import { expect, it } from 'vitest';
import type { LinkBox } from '../../../src/model/bounds.ts';
import { RobotRow } from '../../../src/scene/figure/robot_row.ts';

/** A robot of this width and height, with its root in the middle of its floor; null: not loaded yet. */
function robot(size: [number, number, number] | null, heading = 0) {
  const made = {
    size,
    heading,
    y: 0,
    get figure() {
      if (size === null) return null;
      const root = { matrixWorld: { elements: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, made.y, 0, 1] } };
      const [x, y, z] = size;
      const box: LinkBox = { min: [-x / 2, -y / 2, 0], max: [x / 2, y / 2, z] };
      return { root, boxes: [[root, box] as const] };
    },
    standAside: (y: number) => {
      made.y = y;
    },
    box: () => {
      if (size === null) return null;
      const [x, y, z] = size;
      return { min: [-x / 2, made.y - y / 2, 0], max: [x / 2, made.y + y / 2, z] } as const;
    },
    dispose: () => {},
  };
  return made;
}

function line(...robots: ReturnType<typeof robot>[]): RobotRow<ReturnType<typeof robot>> {
  const made = new RobotRow<ReturnType<typeof robot>>();
  for (const each of robots) made.add(each);
  return made;
}

it('one stands where it is, and looks where it looks', () => {
  const alone = line(robot([0.4, 0.6, 1.3], 0.7));
  expect(alone.arrange()?.max).toEqual([0.2, 0.3, 1.3]);
  expect(alone.middle()).toEqual({ x: 0, y: 0 });
  expect([alone.several, alone.heading]).toEqual([false, 0.7]);
});

it('several stand apart, have their middle between them, and look nowhere together', () => {
  const [first, second] = [robot([0.4, 0.6, 1.3], 0.7), robot([0.4, 0.6, 1.3], 0.2)];
  const both = line(first, second);
  const box = both.arrange();
  expect(second.y - first.y).toBeGreaterThan(0.6);
  expect(box?.min[1]).toBeCloseTo(-box!.max[1], 9);
  expect(both.middle()?.y).toBeCloseTo(0, 9);
  const span = both.span()!;
  expect([span.x, span.y, span.low, span.high]).toEqual([0, expect.closeTo(0, 9), 0, 1.3]);
  expect(span.radius).toBeCloseTo(Math.hypot(0.2, box!.max[1]), 9);
  expect([both.several, both.heading]).toEqual([true, 0]);
});

it('one that is not there yet has no middle, and takes no part in the picture', () => {
  const none = line(robot(null));
  expect(none.arrange()).toBeNull();
  expect(none.middle()).toBeNull();
  expect(none.span()).toBeNull();
});
