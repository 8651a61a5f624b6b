import type { Level } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import {
  drawCapture,
  drawMass,
  drawPressure,
  drawSupport,
  marginLine,
} from '../../../src/scene/signs/balance_marks.ts';
import { faint, paintsOf } from '../../../src/scene/signs/balance_shapes.ts';
import { Footprints, KEPT_S } from '../../../src/scene/signs/footprints.ts';
import { drawJointLimits } from '../../../src/scene/signs/joint_arc.ts';
import { FACET_AT, FACET_STRIDE, Facets } from '../../../src/scene/signs/strokes.ts';
import type { Balance, FootBalance } from '../../../src/twin/balance/balance.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';
import { jointsAt } from '../../rigs/joints.ts';
import { sampleLeg } from '../../rigs/leg_sample.ts';
import { signFrame, signPicture } from '../../rigs/signs.ts';

const PICTURE = signPicture();
const { colors: TONES } = PICTURE;
const PAINTS = paintsOf(PICTURE, 'ok');

const SOLE: readonly Vec3[] = [
  [-0.1, -0.05, 0],
  [0.1, -0.05, 0],
  [0.1, 0.05, 0],
  [-0.1, 0.05, 0],
];

const moved = (corners: readonly Vec3[], by: Vec3) =>
  corners.map(([x, y, z]): Vec3 => [x + by[0], y + by[1], z + by[2]]);

function foot(changed: Partial<FootBalance> = {}): FootBalance {
  const plain = { name: 'RF', link: 'foot', bears: true, forceN: 200, atEdge: false } as const;
  return { ...plain, pressure: [0, 0, 0], corners: SOLE, normal: [0, 0, 1], ...changed };
}

/** A robot on one foot, with its mass over the middle of the sole. */
function standing(changed: Partial<Balance> = {}): Balance {
  return {
    massKg: 40,
    centreOfMass: [0, 0, 0.6],
    velocity: [0, 0, 0],
    slide: null,
    capturePoint: [0, 0, 0],
    floorM: 0,
    ground: 'measured',
    polygon: SOLE.map(([x, y]) => [x, y] as const),
    nearestEdge: 0,
    marginM: 0.05,
    pressure: [0, 0, 0],
    feet: [foot()],
    gaps: { centreOfMass: null, polygon: null, margin: null, pressure: null, capturePoint: null },
    ...changed,
  };
}

interface Drawn {
  readonly color: string;
  readonly opacity: number;
  readonly corners: readonly Vec3[];
}

function drawn(draw: (facets: Facets) => void): Drawn[] {
  const facets = new Facets();
  facets.begin();
  draw(facets);
  facets.end();
  return Array.from({ length: facets.count }, (_, i) => {
    const numbers = facets.numbers.subarray(i * FACET_STRIDE, (i + 1) * FACET_STRIDE);
    const part = (at: number) => Math.round(numbers[FACET_AT.tint + at]! * 255);
    const triple = (at: number): Vec3 => [numbers[at]!, numbers[at + 1]!, numbers[at + 2]!];
    return {
      color: hex((part(0) << 16) | (part(1) << 8) | part(2)),
      opacity: numbers[FACET_AT.tint + 3]!,
      corners: [triple(0), triple(3), triple(6)],
    };
  });
}

function hex(color: number): string {
  return color.toString(16).padStart(6, '0');
}

/** Twice the area on the floor; positive if seen from above. */
function turn({ corners: [a, b, c] }: Drawn): number {
  return (b![0] - a![0]) * (c![1] - a![1]) - (c![0] - a![0]) * (b![1] - a![1]);
}

function support(changed: Partial<Balance>, level: Level = 'ok'): Drawn[] {
  const balance = standing(changed);
  const paints = paintsOf(PICTURE, level);
  return drawn((facets) => drawSupport(facets, balance, marginLine(balance, 0.01), level, 0.01, 1, paints));
}

describe('the support', () => {
  it('all of it is seen from above', () => {
    for (const level of ['ok', 'caution', 'fault'] as const)
      for (const facet of support({}, level)) expect(turn(facet)).toBeGreaterThan(0);
  });

  it('is dashed and lighter where it is assumed', () => {
    const [measured, assumed] = [support({}), support({ ground: 'lowest' })];
    expect(assumed.length, 'dashes').toBeGreaterThan(measured.length + 6);
    expect(assumed[0]!.opacity).toBeLessThan(measured[0]!.opacity);
  });

  it('nothing without a polygon', () => {
    expect(support({ polygon: [], nearestEdge: null, marginM: null })).toEqual([]);
  });

  it('has no edge marked without a mass', () => {
    const unknown = { centreOfMass: null, nearestEdge: null, marginM: null };
    expect(support(unknown).length).toBe(support({}).length - 4);
  });

  it('says a level by its shape too: a triangle, an octagon', () => {
    const plain = support({}).length;
    expect(support({}, 'caution').length).toBe(plain + 2 + 1 + 1); // 2: the edge's dark borders; then the sign's, and the sign
    expect(support({}, 'fault').length).toBe(plain + 2 + 6 + 6);
    const colors = (level: Level) => new Set(support({}, level).map(({ color }) => color));
    expect(colors('ok')).toEqual(new Set([hex(TONES.level)]));
    expect(colors('caution')).toContain(hex(TONES.caution));
    expect(colors('caution')).not.toContain(hex(TONES.fault));
    expect(colors('fault')).toContain(hex(TONES.fault));
  });

  it('an edge that is near is wider than the others, with dark borders', () => {
    const wide = (level: Level, color: string) => {
      const ys = support({}, level).flatMap((one) =>
        one.color === color ? one.corners.map(([, y]) => y) : [],
      );
      return Math.max(...ys.filter((y) => y < -0.02)) - -0.05; // the edge lies at y = -0.05
    };
    const amber = wide('caution', hex(TONES.caution));
    const border = wide('caution', hex(PAINTS.black.color));
    expect(amber).toBeGreaterThan(1.5 * wide('ok', hex(TONES.level)));
    expect(border).toBeGreaterThan(amber + 0.005);
  });

  it('the sign of a level stands outside, beside the nearest edge', () => {
    const added = support({}, 'caution').slice(support({}).length + 2);
    for (const { corners } of added) for (const [, y] of corners) expect(y).toBeLessThan(-0.05);
  });

  it('measures the margin at right angles inside, to the corner outside', () => {
    expect(marginLine(standing({ centreOfMass: [0.02, 0, 1] }), 0)?.edge[0]).toBeCloseTo(0.02);
    const outside = standing({ centreOfMass: [0.3, -0.2, 1], marginM: -0.25 });
    expect(marginLine(outside, 0)?.edge).toEqual([expect.closeTo(0.1), expect.closeTo(-0.05), 0]);
    expect(marginLine(standing({ centreOfMass: null, nearestEdge: null, marginM: null }), 0)).toBeNull();
  });
});

describe('paints', () => {
  it('all are grey when the pose is old', () => {
    const { white, black, ...paints } = paintsOf(signPicture(signFrame({}, { live: false })), 'fault');
    expect(new Set(Object.values(paints).map(({ color }) => color))).toEqual(new Set([TONES.stale]));
    expect(white.color).toBe(TONES.stale);
    expect(black.color).not.toBe(TONES.stale);
  });

  it('follow the palette for colour-blind eyes', () => {
    const safe = signFrame({}, { settings: { palette: 'safe' } });
    expect(paintsOf(signPicture(safe), 'fault').margin.color).toBe(TONES.safe.fault);
    expect(faint(faint(PAINTS.mass, 0.5), 0.5).opacity).toBe(0.25);
  });
});

describe('the mass', () => {
  it('is a ball of black and white parts in a rim, over a plumb line', () => {
    const ball = drawn((facets) => drawMass(facets, [0, 0, 1], [0, 0, 0], [1, 0, 0], 1, PAINTS));
    const of = (color: number) => ball.filter((facet) => facet.color === hex(color));
    const [white, black] = [of(PAINTS.white.color), of(PAINTS.black.color)];
    expect(white.length).toBe(black.length);
    expect(white.length).toBeGreaterThan(100);
    for (const { corners } of white) {
      const [x, y, z] = [0, 1, 2].map((axis) => corners.reduce((sum, at) => sum + at[axis]! / 3, 0));
      expect(x! * y! * (z! - 1), 'each white part is beside black ones only').toBeGreaterThan(0);
    }
    for (const facet of [...white, ...black]) {
      const outward = facet.corners.reduce((sum, [, , z]) => sum + (z - 1), 0) * turn(facet);
      expect(outward, 'seen from outside').toBeGreaterThanOrEqual(-1e-9);
    }
    expect(Math.min(...of(PAINTS.mass.color).flatMap(({ corners }) => corners.map(([, , z]) => z)))).toBe(0);
  });

  it('has no plumb line without a floor', () => {
    const flying = drawn((facets) => drawMass(facets, [0, 0, 1], null, [1, 0, 0], 1, PAINTS));
    expect(Math.min(...flying.flatMap(({ corners }) => corners.map(([, , z]) => z)))).toBeGreaterThan(0.9);
  });

  it('has a capture point as soon as that leaves the mark of its foot', () => {
    const capture = (x: number) =>
      drawn((facets) => {
        expect(drawCapture(facets, [0, 0, 0], [x, 0, 0], [1, 0, 0], 1, PAINTS)).toBe(x > 0.05);
      });
    expect(capture(0.01)).toEqual([]);
    const alone = capture(0.06).length;
    expect(alone, 'a hollow square').toBe(8);
    expect(capture(0.3).length, 'and a line').toBe(alone + 2);
  });
});

describe('the pressure', () => {
  const pressed = (changed: Partial<Balance>) =>
    drawn((facets) => drawPressure(facets, standing(changed), 0.01, 0.01, 1, PAINTS));

  it('is a disc for each foot, and a hoop that the mark of the mass fits in', () => {
    const one = pressed({ feet: [] });
    const far = one.flatMap(({ corners }) => corners.map(([x, y]) => Math.hypot(x, y)));
    expect(Math.min(...far)).toBeGreaterThan(0.043);
    expect(pressed({}).length).toBeGreaterThan(one.length);
    expect(pressed({ pressure: null, feet: [foot({ pressure: null })] })).toEqual([]);
  });

  it('at the edge of the sole it is amber, and a bar lies along that edge', () => {
    const edge = pressed({ pressure: null, feet: [foot({ atEdge: true, pressure: [0.098, 0.01, 0] })] });
    const inside = pressed({ pressure: null, feet: [foot({ pressure: [0.05, 0.01, 0] })] });
    expect(edge.length).toBe(inside.length + 2);
    expect(inside.some(({ color }) => color === hex(TONES.caution))).toBe(false);
    const bar = edge.slice(-2).flatMap(({ corners }) => corners);
    for (const [x] of bar) expect(x).toBeGreaterThanOrEqual(0.1 - 1e-6);
  });

  it('lies in the sole of a foot that is tilted', () => {
    const tilted = SOLE.map(([x, y]): Vec3 => [0, y, x + 0.1]); // on its heel, upright
    const drawing = pressed({
      pressure: null,
      feet: [foot({ corners: tilted, normal: [-1, 0, 0], pressure: [0, 0, 0.1] })],
    });
    for (const { corners } of drawing) for (const [x] of corners) expect(Math.abs(x)).toBeCloseTo(0.01);
  });
});

describe('footprints', () => {
  const walk = (prints: Footprints, tS: number, at: Vec3, bears = true, anchored = true) =>
    prints.take(
      standing({ centreOfMass: [at[0], at[1], 0.6], feet: [foot({ bears, corners: moved(SOLE, at) })] }),
      tS,
      anchored,
      1,
    );

  it('are where a foot stood, for ten seconds, and grow fainter', () => {
    const prints = new Footprints();
    walk(prints, 0, [0, 0, 0]);
    expect(prints.prints, 'it still stands there').toBe(0);
    walk(prints, 0.1, [0.1, 0, 0.05], false);
    expect(prints.prints).toBe(1);
    const seen = () => drawn((facets) => prints.draw(facets, 0, 1, PAINTS)).map(({ opacity }) => opacity);
    const fresh = Math.max(...seen());
    walk(prints, 5, [0.2, 0, 0.05], false);
    expect(Math.min(...seen())).toBeLessThan(fresh);
    walk(prints, KEPT_S + 0.2, [0.3, 0, 0.05], false);
    expect(prints.prints).toBe(0);
  });

  it('the trace has a bound, and none of a robot that stands still', () => {
    const prints = new Footprints();
    for (let i = 0; i < 100; i += 1) walk(prints, i * 0.1, [0, 0, 0]);
    expect(prints.points).toBe(1);
    for (let i = 0; i < 5000; i += 1) walk(prints, 10 + i * 0.01, [i * 0.01, 0, 0]);
    expect(prints.points).toBeLessThanOrEqual(200);
  });

  it('are forgotten when time goes back, or the robot is put elsewhere', () => {
    for (const [tS, at] of [
      [0.5, [0.1, 0, 0]],
      [2, [5, 0, 0]],
    ] as const) {
      const prints = new Footprints();
      walk(prints, 0.8, [0, 0, 0]);
      walk(prints, 0.9, [0, 0, 0.05], false);
      walk(prints, 1, [0.1, 0, 0]);
      expect([prints.prints, prints.points]).toEqual([1, 2]);
      walk(prints, tS, at);
      expect([prints.prints, prints.points]).toEqual([0, 1]);
    }
  });
});

describe('the limits of a joint', () => {
  function leg(limits: { lower: number; upper: number } | null) {
    const made = sampleLeg();
    (made.manifest.joints[1] as { limits: unknown }).limits = limits;
    made.setJoints(jointsAt({ knee: 0.5 }));
    made.ground();
    return made;
  }
  const arc = (body: ReturnType<typeof leg>, name: string) => {
    let left: number | undefined;
    const facets = drawn((into) => {
      left = drawJointLimits(into, { ...PICTURE, body, reach: 1 }, [name], PAINTS)[0]?.shown.left;
    });
    return { left, count: facets.length };
  };

  it('are drawn with what is left to the nearer one', () => {
    expect(arc(leg({ lower: -0.1, upper: 2 }), 'knee').left).toBeCloseTo(0.6);
    expect(arc(leg({ lower: -2, upper: 0.7 }), 'knee').left).toBeCloseTo(0.2);
    expect(arc(leg({ lower: -2, upper: 0.4 }), 'knee').left, 'beyond').toBeCloseTo(-0.1);
    expect(arc(leg({ lower: -2, upper: 0.4 }), 'knee').count).toBeGreaterThan(20);
  });

  it('none for a joint without limits, with limits that cross, or that the model lacks', () => {
    for (const limits of [null, { lower: 1, upper: -1 }])
      expect(arc(leg(limits), 'knee')).toEqual({ left: undefined, count: 0 });
    expect(arc(leg(null), 'elbow')).toEqual({ left: undefined, count: 0 });
  });
});
