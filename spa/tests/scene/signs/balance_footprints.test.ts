import { expect, it } from 'vitest';
import { paintsOf } from '../../../src/scene/signs/balance_shapes.ts';
import { Footprints } from '../../../src/scene/signs/footprints.ts';
import { Facets } from '../../../src/scene/signs/strokes.ts';

import type { Foot } from '../../../src/twin/balance/balance.ts';
import { Balancer } from '../../../src/twin/balance/balancer.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';
import { signPicture } from '../../rigs/signs.ts';

/** The pose of a link, rotated by `yaw` (rad) about the vertical. */
interface Place {
  readonly at: Vec3;
  readonly yaw?: number;
}

const UNKNOWN: Place = { at: [Number.NaN, 0, 0] };

function foot(name: string, link: number, measured = false): Foot {
  const corners: readonly Vec3[] = [
    [-0.1, -0.05, 0],
    [0.1, -0.05, 0],
    [0.1, 0.05, 0],
    [-0.1, 0.05, 0],
  ];
  const axes = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ] as const;
  const sensor = { site: name, xyz: [0, 0, 0], axes, measuresForce: true, measuresPressure: true } as const;
  const sole = { corners, normal: [0, 0, 1], centre: [0, 0, 0] } as const;
  return { name, link, linkName: name, sole, sensor: measured ? sensor : null };
}

/** A robot of a trunk with all its mass, and two feet; poses one tenth of a second apart. */
class Walker {
  readonly left = new Footprints();
  readonly #balancer: Balancer;
  readonly #anchored: boolean;
  #tS = 0;

  constructor({ anchored = false, masses = true, measured = false } = {}) {
    this.#anchored = anchored;
    this.#balancer = new Balancer({
      ...{
        masses: masses ? [{ link: 0, massKg: 40, xyz: [0, 0, 0] }] : [],
        massGap: masses ? null : 'no-masses',
      },
      ...{ feet: [foot('R', 1, measured), foot('L', 2, measured)], footGap: null },
      ...{ ground: measured ? 'measured' : 'lowest', problems: [] },
    });
  }

  step(trunk: Place, right: Place, left: Place, { afterS = 0.1, unread = false } = {}): this {
    this.#tS += afterS;
    const places = [trunk, right, left].flatMap(({ at: [x, y, z], yaw = 0 }) => {
      const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
      return [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, x, y, z, 1];
    });
    const force = { vector: unread ? null : ([0, 0, 200] as const), axes: [0, 1, 2] };
    const moment = { vector: [0, 0, 0] as const, axes: [0, 1, 2] };
    const wrenches = ['R', 'L'].map((site) => ({ site, force, moment }));
    this.#balancer.update(Float64Array.from(places), wrenches, this.#tS);
    this.left.take(this.#balancer, this.#tS, this.#anchored, 1);
    return this;
  }

  /** The middle of the newest footprint, from its first two facets. */
  get lastPrint(): number[] {
    const facets = new Facets();
    facets.begin();
    this.left.draw(facets, 0, 1, paintsOf(signPicture(), 'ok'));
    facets.end();
    const perPrint = 2 + 4 * 2; // its fill and its outline
    const at = (this.left.prints - 1) * perPrint * facets.stride;
    const [x1, y1, , , , , x3, y3] = facets.numbers.subarray(at, at + facets.stride);
    return [(x1! + x3!) / 2, (y1! + y3!) / 2];
  }
}

const near = (...values: number[]) => values.map((value) => expect.closeTo(value, 6));

it('without odometry what was left moves and turns with the foot that stands', () => {
  const walker = new Walker();
  // The scene keeps the trunk at its origin: the right foot stands, and the left one is raised.
  walker.step({ at: [0, 0, 1] }, { at: [0, -0.1, 0] }, { at: [0, 0.1, 0] });
  walker.step({ at: [0, 0, 1] }, { at: [0, -0.1, 0] }, { at: [0, 0.1, 0.05] });
  expect(walker.lastPrint).toEqual(near(0, 0.1));
  walker.step({ at: [0, 0, 1] }, { at: [-0.2, -0.1, 0] }, { at: [0.1, 0.1, 0.05] });
  expect(walker.lastPrint).toEqual(near(-0.2, 0.1));
  walker.step({ at: [0, 0, 1] }, { at: [-0.2, -0.1, 0], yaw: Math.PI / 2 }, { at: [0.1, 0.1, 0.05] });
  expect(walker.lastPrint).toEqual(near(-0.4, -0.1));
});

it('so it does where no masses are known, without a trace', () => {
  const walker = new Walker({ masses: false });
  walker.step({ at: [0, 0, 1] }, { at: [0, -0.1, 0] }, { at: [0, 0.1, 0] });
  walker.step({ at: [0, 0, 1] }, { at: [-0.1, -0.1, 0] }, { at: [0.1, 0.1, 0.05] });
  expect([walker.left.prints, walker.left.points]).toEqual([1, 0]);
  expect(walker.lastPrint).toEqual(near(-0.1, 0.1));
});

it('by odometry it stays where it was', () => {
  const walker = new Walker({ anchored: true });
  walker.step({ at: [0, 0, 1] }, { at: [0, -0.1, 0] }, { at: [0, 0.1, 0] });
  walker.step({ at: [0.1, 0, 1] }, { at: [0.02, -0.1, 0] }, { at: [0.1, 0.1, 0.05] });
  walker.step({ at: [0.2, 0, 1] }, { at: [0.02, -0.1, 0] }, { at: [0.3, 0.1, 0] });
  expect(walker.lastPrint).toEqual(near(0, 0.1));
  expect(walker.left.points).toBe(3);
});

it('begins anew where no foot is shared with the pose before, and after a gap', () => {
  for (const [right, afterS] of [
    [0.2, 0.1],
    [0, 0.8],
  ] as const) {
    const walker = new Walker();
    walker.step({ at: [0, 0, 1] }, { at: [0, -0.1, 0] }, { at: [0, 0.1, 0] });
    walker.step({ at: [0, 0, 1] }, { at: [0, -0.1, 0] }, { at: [0, 0.1, 0.05] });
    expect(walker.left.prints).toBe(1);
    // Either the left foot alone now bears weight, or it is unknown where the right one has been.
    walker.step({ at: [0, 0, 1] }, { at: [0, -0.1, right] }, { at: [0, 0.1, right / 2] }, { afterS });
    expect([walker.left.prints, walker.left.points]).toEqual([0, 1]);
  }
});

it('leaves out poses in which nobody knows what bears', () => {
  const walker = new Walker({ measured: true });
  walker.step({ at: [0, 0, 1] }, { at: [0, -0.1, 0] }, { at: [0, 0.1, 0] });
  walker.step({ at: [9, 9, 1] }, { at: [9, 9, 0] }, { at: [9, 9, 0] }, { unread: true });
  walker.step(UNKNOWN, { at: [0.1, -0.1, 0] }, { at: [0.1, 0.1, 0] });
  expect([walker.left.prints, walker.left.points]).toEqual([0, 0]);
  const steady = new Walker({ measured: true });
  steady.step({ at: [0, 0, 1] }, { at: [0, -0.1, 0] }, { at: [0, 0.1, 0] });
  steady.step({ at: [9, 9, 1] }, { at: [9, 9, 0] }, { at: [9, 9, 0] }, { unread: true });
  steady.step({ at: [0, 0, 1] }, { at: [-0.1, -0.1, 0] }, { at: [-0.1, 0.1, 0] });
  expect([steady.left.prints, steady.left.points]).toEqual([0, 2]);
});
