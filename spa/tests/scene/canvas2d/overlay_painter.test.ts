import { expect, it } from 'vitest';
import { Strokes } from '../../../src/scene/signs/strokes.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';
import { paintedStrokes } from '../../rigs/painted_strokes.ts';

const UP: Vec3 = [0, 0, 1];
const RED = 0xff0000;

function painted(draw: (strokes: Strokes) => void, over = true) {
  const strokes = new Strokes();
  strokes.begin();
  draw(strokes);
  strokes.end();
  return paintedStrokes(strokes, over);
}

it('a shaft reaches from its place to its end, a head ends in a point, both where the camera sees them', () => {
  const [shaft] = painted((s) => s.shaft([0, 0, 0.2], UP, 0.5, 0.01, 0.01, { color: RED, through: true }));
  expect(shaft!.how).toBe('fill');
  expect(shaft!.color).toBe('rgb(255 0 0 / 1)');
  const ys = shaft!.points.map(([, y]) => y);
  const xs = shaft!.points.map(([x]) => x);
  expect(Math.max(...ys) - Math.min(...ys)).toBeGreaterThan(60);
  expect((Math.max(...xs) + Math.min(...xs)) / 2).toBeCloseTo(200, 0);
  const [head] = painted((s) => s.shaft([0, 0, 0.2], UP, 0.5, 0.05, 0, { color: RED, through: true }));
  expect(head!.points[1]).toEqual(head!.points[2]!.map((part) => expect.closeTo(part)));
});

it('what is far is painted first, and no line is thinner than can be seen', () => {
  const ring = (x: number, color: number) => (s: Strokes) =>
    s.arc([x, 0, 0.5], UP, [1, 0, 0], Math.PI, 0.2, 0.0001, { color, through: true });
  const order = painted((s) => {
    ring(0.5, 0x0000ff)(s);
    ring(-0.5, RED)(s);
  });
  expect(order.map(({ color }) => color)).toEqual(['rgb(255 0 0 / 1)', 'rgb(0 0 255 / 1)']);
  expect(order.every(({ width }) => width >= 1)).toBe(true);
});

it('what shows through the robot comes after it, the rest before it', () => {
  const both = (s: Strokes) => {
    s.fan([0, 0, 0], UP, [1, 0, 0], 2 * Math.PI, 0, 0.5, { color: 0x00ff00, opacity: 0.1 });
    s.shaft([0, 0, 0], UP, 1, 0.01, 0.01, { color: RED, opacity: 0.5, through: true });
  };
  expect(painted(both, false).map(({ color }) => color)).toEqual(['rgb(0 255 0 / 0.10000000149011612)']);
  expect(painted(both, true).map(({ color }) => color)).toEqual(['rgb(255 0 0 / 0.5)']);
});

it('what lies behind the eye is not painted', () => {
  const far: Vec3 = [50, 0, 0.5]; // the camera looks from there to the origin
  const done = painted((s) => {
    s.shaft(far, UP, 1, 0.1, 0.1, { color: RED, through: true });
    s.arc(far, UP, [1, 0, 0], 1, 0.2, 0.01, { color: RED, through: true });
  });
  expect(done).toEqual([]);
});
