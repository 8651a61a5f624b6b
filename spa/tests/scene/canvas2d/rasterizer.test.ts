import { describe, expect, it } from 'vitest';
import { type Corners, Rasterizer, SHADES } from '../../../src/scene/canvas2d/rasterizer.ts';

const RED = 0xff0000ff;
const BLUE = 0xffff0000;
const STRIPE = 0xff00ff00;
/** Rows: red, its hatching, blue, its hatching. */
const TABLES = Uint32Array.from(
  { length: 4 * SHADES },
  (_, i) => [RED, STRIPE, BLUE, STRIPE][Math.floor(i / SHADES)]!,
);

function corners(...points: readonly (readonly [x: number, y: number, inverseW: number])[]): Corners {
  const at = (i: 0 | 1 | 2) => Float32Array.from(points, (point) => point[i]);
  return { x: at(0), y: at(1), inverseW: at(2), shade: new Float32Array(points.length).fill(100) };
}

function drawn(
  width: number,
  height: number,
  ...triangles: (readonly [Corners, row: number, seen?: number, hatch?: boolean])[]
) {
  const raster = new Rasterizer();
  raster.resize(width, height);
  raster.clear();
  for (const [points, row, seen, hatch] of triangles) {
    const index = Uint32Array.from(points.x.keys());
    raster.draw(points, index, 0, index.length, TABLES, () => row, seen, hatch);
  }
  return raster.pixels;
}

const count = (pixels: Uint32Array, color: number) =>
  pixels.reduce((sum, pixel) => sum + (pixel === color ? 1 : 0), 0);

it('keeps the memory of its largest picture, and shows nothing of it in a smaller one', () => {
  const raster = new Rasterizer();
  raster.resize(40, 40);
  const memory = raster.pixels.buffer;
  raster.pixels.fill(RED);
  for (const [width, height] of [
    [20, 20],
    [40, 40],
    [10, 30],
  ] as const) {
    raster.resize(width, height);
    raster.clear();
    expect(raster.pixels.buffer).toBe(memory);
    expect([raster.pixels.length, raster.bytes.length]).toEqual([width * height, width * height * 4]);
    expect(count(raster.pixels, 0)).toBe(width * height);
  }
  raster.resize(41, 40);
  expect(raster.pixels.buffer).not.toBe(memory);
});

describe('triangles', () => {
  const square = (inverseW: number, from = 0, to = 8) =>
    corners(
      [from, from, inverseW],
      [to, from, inverseW],
      [to, to, inverseW],
      [from, from, inverseW],
      [to, to, inverseW],
      [from, to, inverseW],
    );

  it('that share an edge leave no gap and paint no pixel twice', () => {
    // Half transparent: a pixel that was painted twice would be more opaque than half.
    expect(count(drawn(8, 8, [square(1), 0]), RED)).toBe(64);
    for (const [x, y] of [
      [3.3, 4.7],
      [5, 5],
      [0.5, 6.5],
    ] as const) {
      const fan = [
        [0, 0],
        [8, 0],
        [8, 8],
        [0, 8],
      ].map(([ax, ay], i, all) => {
        const [bx, by] = all[(i + 1) % 4]!;
        return corners([ax!, ay!, 1], [bx!, by!, 1], [x, y, 1]);
      });
      const each = fan.map((triangle) => count(drawn(8, 8, [triangle, 0]), RED));
      expect(each.reduce((sum, n) => sum + n, 0)).toBe(64);
      expect(count(drawn(8, 8, ...fan.map((triangle) => [triangle, 0] as const)), RED)).toBe(64);
    }
  });

  it('that are nearer hide what is behind, in whatever order they come', () => {
    const near = square(2, 2, 6);
    const far = square(1);
    for (const order of [
      [[near, 2] as const, [far, 0] as const],
      [[far, 0] as const, [near, 2] as const],
    ]) {
      const pixels = drawn(8, 8, ...order);
      expect([count(pixels, BLUE), count(pixels, RED)]).toEqual([16, 48]);
    }
  });

  it('that lie across each other are cut where they meet', () => {
    const leaning = corners([0, 0, 1], [8, 0, 3], [8, 8, 3], [0, 0, 1], [8, 8, 3], [0, 8, 1]);
    const pixels = drawn(8, 8, [leaning, 0], [square(2), 2]);
    expect([count(pixels, RED), count(pixels, BLUE)]).toEqual([32, 32]);
    expect(pixels[0]).toBe(BLUE);
    expect(pixels[7]).toBe(RED);
  });

  it('outside the picture, behind the eye or without a surface draw nothing and break nothing', () => {
    for (const [a, b, c] of [
      [
        [-9, -9, 1],
        [-1, -9, 1],
        [-9, -1, 1],
      ],
      [
        [0, 0, 0],
        [8, 0, 1],
        [0, 8, 1],
      ],
      [
        [1, 1, 1],
        [5, 5, 1],
        [3, 3, 1],
      ],
      [
        [Number.NaN, 1, 1],
        [5, 5, 1],
        [3, 3, 1],
      ],
    ] as const) {
      expect(drawn(8, 8, [corners(a, b, c), 0]).every((pixel) => pixel === 0)).toBe(true);
    }
    expect(count(drawn(8, 8, [corners([-1e6, -1e6, 1], [1e6, -1e6, 1], [0, 1e6, 1]), 0]), RED)).toBe(64);
  });

  it('let through what is behind, evenly, and show stripes where they are marked', () => {
    expect(count(drawn(8, 8, [square(1), 0, 0.5]), RED)).toBe(32);
    expect(count(drawn(8, 8, [square(1), 0, 0]), RED)).toBe(0);
    const marked = drawn(21, 21, [square(1, 0, 21), 0, 1, true]);
    expect(count(marked, STRIPE)).toBe(3 * 63);
    expect(count(marked, STRIPE) + count(marked, RED)).toBe(441);
  });
});
