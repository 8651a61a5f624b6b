import { describe, expect, it } from 'vitest';
import {
  AT,
  FACET_AT,
  FACET_STRIDE,
  Facets,
  MOST_FACETS,
  MOST_STROKES,
  STRIDE,
  Strokes,
} from '../../../src/scene/signs/strokes.ts';
import { OverlayMesh } from '../../../src/scene/three/overlay_mesh.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';

const GREEN = { color: 0x00ff00 };
const UP: Vec3 = [0, 0, 1];
const ORIGIN: Vec3 = [0, 0, 0];

function drawn(draw: (strokes: Strokes) => void, strokes = new Strokes()): Strokes {
  strokes.begin();
  draw(strokes);
  strokes.end();
  return strokes;
}

describe('strokes', () => {
  it('are two draw calls on a graphics card, however many there are, and none without', () => {
    const strokes = new Strokes();
    const batch = new OverlayMesh(strokes);
    expect(batch.object.visible).toBe(false);
    drawn((s) => {
      for (let i = 0; i < 50; i += 1) s.shaft(ORIGIN, UP, 1, 0.1, 0.1, GREEN);
    }, strokes);
    batch.update();
    expect(batch.object.children.length).toBe(2);
    expect(batch.object.visible).toBe(true);
    drawn(() => {}, strokes);
    batch.update();
    expect(batch.object.visible).toBe(false);
  });

  it('come in the order of drawing, those that are seen through last, a turn backwards as one forwards', () => {
    const strokes = drawn((s) => {
      s.fan(ORIGIN, UP, [1, 0, 0], -1, 0, 1, { color: 0xff8000, opacity: 0.5, through: true });
      s.shaft(ORIGIN, [1, 0, 0], 2, 0.1, 0.05, GREEN);
    });
    const stroke = (i: number) => [...strokes.numbers.subarray(i * STRIDE, (i + 1) * STRIDE)];
    expect(stroke(0).slice(AT.shape, AT.manner)).toEqual([0, 2, 0.1, 0.05].map((n) => expect.closeTo(n)));
    expect(stroke(1).slice(AT.axis, AT.shape)).toEqual([-0, -0, -1]);
    expect(stroke(1)[AT.shape]).toBe(1);
    expect(stroke(1)[AT.manner + 1]).toBe(1);
    expect(stroke(1).slice(AT.tint)).toEqual([1, expect.closeTo(128 / 255), 0, 0.5]);
  });
});

const CORNERS: readonly [Vec3, Vec3, Vec3] = [
  [1, 2, 3],
  [4, 5, 6],
  [7, 8, 9],
];

it('facets keep corners, colour and whether they show through, in the order in which they came', () => {
  const facets = new Facets();
  facets.begin();
  facets.add(...CORNERS, { color: 0xff8000, opacity: 0.5, through: true });
  facets.add(...CORNERS, { color: 0x000000 });
  expect(facets.count, 'not before it is complete').toBe(0);
  expect(facets.end()).toBe(true);
  expect(facets.count).toBe(2);
  const [one, other] = [0, FACET_STRIDE];
  expect([...facets.numbers.subarray(one, one + 9)]).toEqual([1, 2, 3, 4, 5, 6, 7, 8, 9]);
  const tint = [...facets.numbers.subarray(one + FACET_AT.tint, one + FACET_AT.tint + 4)];
  expect(tint.map((part) => Math.round(part * 255))).toEqual([255, 128, 0, 128]);
  expect(facets.numbers[one + FACET_AT.through]).toBe(1);
  expect(facets.numbers[other + FACET_AT.tint + 3], 'opaque unless it says so').toBe(1);
  expect(facets.numbers[other + FACET_AT.through]).toBe(0);
});

describe.each([
  [
    'strokes',
    () => {
      const strokes = new Strokes();
      return {
        of: strokes,
        add: (x: number) => strokes.fan(ORIGIN, UP, [1, 0, 0], x, 0, 1, { ...GREEN, opacity: 0.3 }),
      };
    },
    MOST_STROKES,
  ],
  [
    'facets',
    () => {
      const facets = new Facets();
      return { of: facets, add: (x: number) => facets.add([x, 0, 0], CORNERS[1], CORNERS[2], GREEN) };
    },
    MOST_FACETS,
  ],
] as const)('%s', (_, begin, most) => {
  it('know when they are the picture before, and leave out what is too much', () => {
    const { of, add } = begin();
    const make = (x: number, count = 1) => {
      of.begin();
      for (let i = 0; i < count; i += 1) add(x);
      return of.end();
    };
    expect([make(1), make(1), make(2), make(2), make(2, 2), make(2, 0)]).toEqual([
      true,
      false,
      true,
      false,
      true,
      true,
    ]);
    expect(of.count).toBe(0);
    make(1, most + 10);
    expect(of.count).toBe(most);
  });
});
