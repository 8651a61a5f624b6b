import { expect, it } from 'vitest';
import { Facets } from '../overlays/balance/facets.ts';
import type { Paint } from '../overlays/picture_numbers.ts';
import type { Vec3 } from '../twin/rotation.ts';
import { CameraRig } from '../view/camera/camera_rig.ts';
import { paintFacets } from './facet_painter.ts';
import type { FloorView } from './floor.ts';

/** The fills in order: colour, and the points of the path. */
function recorder() {
  const done: { color: string; points: [number, number][] }[] = [];
  let points: [number, number][] = [];
  const context = {
    fillStyle: '',
    beginPath: () => {
      points = [];
    },
    moveTo: (x: number, y: number) => points.push([x, y]),
    lineTo: (x: number, y: number) => points.push([x, y]),
    fill: () => done.push({ color: context.fillStyle, points }),
  };
  return { context: context as unknown as CanvasRenderingContext2D, done };
}

/** From the front: x points towards the eye, y to the right of the picture. */
function sight(): FloorView {
  const eye = new CameraRig();
  eye.resize(400, 300);
  eye.frame([-0.3, -0.3, 0], [0.3, 0.3, 1.2], false);
  eye.look('front', false);
  const { reach } = eye;
  return { screenFromWorld: eye.screenFromWorld(), width: 400, height: 300, reach, fade: reach, x: 0, y: 0 };
}

const A: Vec3 = [0, -0.1, 0.5];
const B: Vec3 = [0, 0.1, 0.5];
const C: Vec3 = [0, 0, 0.7];
const RED: Paint = { color: 0xff0000, through: true };
const BLUE: Paint = { color: 0x0000ff, opacity: 0.5, through: true };

function painted(draw: (facets: Facets) => void, over = true) {
  const facets = new Facets();
  facets.begin();
  draw(facets);
  facets.end();
  const { context, done } = recorder();
  paintFacets(context, sight(), facets, over);
  return done;
}

it('paints what is seen from its front, and nothing from behind', () => {
  const front = painted((facets) => facets.add(A, B, C, RED));
  expect(front.map(({ color, points }) => [color, points.length])).toEqual([['rgb(255 0 0 / 1.000)', 3]]);
  for (const [x, y] of front[0]!.points) {
    expect(x).toBeGreaterThan(100);
    expect(x).toBeLessThan(300);
    expect(y).toBeGreaterThan(0);
    expect(y).toBeLessThan(300);
  }
  expect(painted((facets) => facets.add(A, C, B, RED))).toEqual([]);
});

it('neighbours of one colour are one path, so that no seam shows; the order stays', () => {
  const done = painted((facets) => {
    facets.add(A, B, C, RED);
    facets.add(A, B, C, RED);
    facets.add(A, B, C, BLUE);
    facets.add(A, B, C, RED);
  });
  expect(done.map(({ color, points }) => [color, points.length])).toEqual([
    ['rgb(255 0 0 / 1.000)', 6],
    ['rgb(0 0 255 / 0.500)', 3],
    ['rgb(255 0 0 / 1.000)', 3],
  ]);
});

it('what shows through the robot is painted after it, the rest before', () => {
  const both = (facets: Facets) => {
    facets.add(A, B, C, { ...RED, through: false });
    facets.add(A, B, C, BLUE);
  };
  expect(painted(both, true).map(({ color }) => color)).toEqual(['rgb(0 0 255 / 0.500)']);
  expect(painted(both, false).map(({ color }) => color)).toEqual(['rgb(255 0 0 / 1.000)']);
});

it('leaves out what reaches behind the eye', () => {
  expect(painted((facets) => facets.add(A, [100, 0.1, 0.5], C, RED))).toEqual([]);
});
