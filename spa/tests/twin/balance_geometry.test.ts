import fc from 'fast-check';
import { describe, expect, it } from 'vitest';
import { planeOfSole } from '../../src/model/balance/standing_choice.ts';
import type { Vec2 } from '../../src/twin/balance/balance.ts';
import { captureTime } from '../../src/twin/balance/balancer.ts';
import { convexHull, marginIn } from '../../src/twin/balance/polygon.ts';
import { limitMargin } from '../../src/twin/limits.ts';

/** Millimetres on a grid, so that there are duplicate points and straight edges, and no slivers. */
const points = (least: number) =>
  fc.array(fc.tuple(fc.integer({ min: -20, max: 20 }), fc.integer({ min: -20, max: 20 })), {
    minLength: least,
    maxLength: 24,
  });

const metres = (grid: readonly (readonly [number, number])[]): Vec2[] =>
  grid.map(([x, y]) => [x / 100, y / 100]);

function hullOf(corners: readonly Vec2[]): Vec2[] {
  return convexHull(corners).map((i) => corners[i]!);
}

function turn(a: Vec2, b: Vec2, c: Vec2): number {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/** Jarvis' march: from the lowest point, always to the point with all others on its left. */
function giftWrap(corners: readonly Vec2[]): Vec2[] {
  const start = corners.reduce((a, b) => (b[0] < a[0] || (b[0] === a[0] && b[1] < a[1]) ? b : a));
  const found: Vec2[] = [];
  let at = start;
  do {
    found.push(at);
    let next = corners.find((one) => one[0] !== at[0] || one[1] !== at[1]);
    if (next === undefined) break;
    for (const one of corners) {
      const side = turn(at, next, one);
      const farther =
        Math.hypot(one[0] - at[0], one[1] - at[1]) > Math.hypot(next[0] - at[0], next[1] - at[1]);
      if (side < -1e-9 || (Math.abs(side) <= 1e-9 && farther)) next = one;
    }
    at = next;
  } while (at[0] !== start[0] || at[1] !== start[1]);
  return found;
}

describe('the convex hull', () => {
  it('is that of another way to find it', () => {
    fc.assert(
      fc.property(points(1), (grid) => {
        const corners = metres(grid);
        expect(hullOf(corners)).toEqual(giftWrap(corners));
      }),
      { seed: 1, numRuns: 500 },
    );
  });

  it('of feet side by side has no corner in the middle of an edge, however they are turned', () => {
    fc.assert(
      fc.property(fc.double({ min: 0, max: 6.3, noNaN: true }), (angle) => {
        const [c, s] = [Math.cos(angle), Math.sin(angle)];
        const square = (y: number) => [-0.1, 0.1].flatMap((x) => [y, y + 0.08].map((v): Vec2 => [x, v]));
        const corners = [...square(-0.12), ...square(0.04)];
        expect(hullOf(corners.map(([x, y]): Vec2 => [c * x - s * y + 3, s * x + c * y])).length).toBe(4);
      }),
      { seed: 3, numRuns: 200 },
    );
  });
});

describe('the margin', () => {
  const square: Vec2[] = [
    [0, 0],
    [0.2, 0],
    [0.2, 0.1],
    [0, 0.1],
  ];
  const marginAt = (polygon: readonly Vec2[], x: number, y: number) => marginIn(polygon, [x, y]);

  it.each([
    [0.1, 0.02, 0.02, 0],
    [0.19, 0.05, 0.01, 1],
    [0.1, 0.13, -0.03, 2],
    [-0.03, 0.14, -0.05, 2],
    [0, 0.05, 0, 3],
  ])('of (%d, %d) is %d m to edge %d', (x, y, metres, edge) => {
    expect(marginAt(square, x, y)).toEqual({ metres: expect.closeTo(metres, 12), edge });
  });

  it('has no inside where a polygon has none', () => {
    expect(marginAt([[0, 0]], 0.3, 0.4).metres).toBeCloseTo(-0.5, 12);
    expect(marginAt(square.slice(0, 2), 0.1, 0).metres).toBeCloseTo(0, 12);
    expect(marginAt(square.slice(0, 2), 0.1, 0.01).metres).toBeCloseTo(-0.01, 12);
  });

  it('changes by no more than the point moves, and its sign tells in from out', () => {
    const at = fc.double({ min: -0.4, max: 0.4, noNaN: true });
    fc.assert(
      fc.property(points(3), at, at, at, at, (grid, x, y, u, v) => {
        const polygon = hullOf(metres(grid));
        fc.pre(polygon.length >= 3);
        const [a, b] = [marginAt(polygon, x, y).metres, marginAt(polygon, u, v).metres];
        expect(Math.abs(a - b)).toBeLessThanOrEqual(Math.hypot(x - u, y - v) + 1e-12);
        // Outside means that the point would be a corner of the hull itself.
        const isCorner = hullOf([...polygon, [x, y]]).some((one) => one[0] === x && one[1] === y);
        if (Math.abs(a) > 1e-4) expect(a < 0).toBe(isCorner);
      }),
      { seed: 4, numRuns: 500 },
    );
  });
});

it('the capture point is √(z/g) ahead for each m/s, and not ahead at the floor or below', () => {
  expect(captureTime(9.81 / 4)).toBeCloseTo(0.5, 12);
  expect([captureTime(0), captureTime(-1)]).toEqual([0, 0]);
});

describe('the limit margin', () => {
  const limits = { lower: -1, upper: 3 };

  it.each([
    [1, { left: 2, nearer: 'lower', part: 1 }],
    [2.5, { left: 0.5, nearer: 'upper', part: 0.25 }],
    [-1.5, { left: -0.5, nearer: 'lower', part: -0.25 }],
  ] as const)('of %d rad', (value, margin) => {
    expect(limitMargin(value, limits)).toEqual(margin);
  });

  it('is none without a reading, limits or a range', () => {
    expect(limitMargin(null, limits)).toBeNull();
    expect(limitMargin(Number.NaN, limits)).toBeNull();
    expect(limitMargin(1, null)).toBeNull();
    expect(limitMargin(0, { lower: 0, upper: 0 })).toBeNull();
    expect(limitMargin(0, { lower: 1, upper: -1 })).toBeNull();
  });
});

describe('a sole', () => {
  const UP = [0, 0, 1] as const;

  it('takes its corners in any order, and points within it away', () => {
    const corners = [
      [0, 0, -0.1],
      [0.2, 0.1, -0.1],
      [0.2, 0, -0.1],
      [0.1, 0.05, -0.1],
      [0, 0.1, -0.1],
    ] as const;
    const sole = planeOfSole(corners, [0, 0, 0]);
    expect(sole?.corners.length).toBe(4);
    expect(sole?.normal).toEqual([0, 0, 1].map((part) => expect.closeTo(part, 12)));
    expect(planeOfSole(corners, [0, 0, -1])?.normal[2]).toBeCloseTo(-1, 12);
    expect(sole?.centre).toEqual([0.1, 0.05, -0.1].map((part) => expect.closeTo(part, 12)));
  });

  it.each([
    [[]],
    [
      [
        [1, 1, 1],
        [1, 1, 1],
        [1, 1, 1],
      ],
    ],
    [
      [
        [0, 0, 0],
        [1, 0, 0],
        [2, 0, 0],
      ],
    ],
    [
      [
        [0, 0, 0],
        [1, 0, Number.NaN],
        [2, 1, 0],
      ],
    ],
  ] as const)('is none where the points span no area: %j', (points) => {
    expect(planeOfSole(points, UP)).toBeNull();
  });
});
