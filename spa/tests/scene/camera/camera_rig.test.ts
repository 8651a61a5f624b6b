import { describe, expect, it } from 'vitest';
import { CameraRig, type RigOptions } from '../../../src/scene/camera/camera_rig.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';

const [WIDTH, HEIGHT] = [800, 600];

function eye(): CameraRig {
  const made = new CameraRig();
  made.resize(WIDTH, HEIGHT);
  made.frame([-0.3, -0.4, 0], [0.3, 0.4, 1.4], false);
  return made;
}

function seen(from: CameraRig, [x, y, z]: Vec3) {
  const m = from.screenFromWorld();
  const row = (r: number) => m[r]! * x + m[r + 1]! * y + m[r + 2]! * z + m[r + 3]!;
  return { x: row(0) / row(8), y: row(4) / row(8), away: row(8) };
}

describe('the eye', () => {
  it('sees the whole robot from every side, its middle in the middle, what is higher higher up', () => {
    for (const view of ['home', 'front', 'side', 'top'] as const) {
      const made = eye();
      made.look(view, false);
      const middle = seen(made, [0, 0, 0.7]);
      expect([middle.x, middle.y]).toEqual([expect.closeTo(WIDTH / 2, 6), expect.closeTo(HEIGHT / 2, 6)]);
      for (const corner of [0, 1, 2, 3, 4, 5, 6, 7]) {
        const at = seen(made, [corner & 1 ? 0.3 : -0.3, corner & 2 ? 0.4 : -0.4, corner & 4 ? 1.4 : 0]);
        expect(at.away).toBeGreaterThan(0);
        expect(at.x > 0 && at.x < WIDTH && at.y > 0 && at.y < HEIGHT, `${view} ${corner}`).toBe(true);
      }
      if (view !== 'top') expect(seen(made, [0, 0, 1]).y).toBeLessThan(HEIGHT / 2);
    }
  });

  it('sees it between what stands over the edges, with all around it', () => {
    const made = eye();
    const { y } = seen(made, [0, 0, 0.7]);
    made.cover({ above: 100, below: 20 });
    expect(seen(made, [0, 0, 0.7]).y).toBeCloseTo(y, 0);
    expect(made.advance(0.1)).toBe(true);
    expect(made.advance(1)).toBe(false);
    expect(seen(made, [0, 0, 0.7]).y).toBeCloseTo(100 + (HEIGHT - 120) / 2, 6);
    for (const [z, x] of [
      [0, 0.3],
      [1.4, -0.3],
    ] as const) {
      const { y } = seen(made, [x, 0, z]);
      expect(y > 100 && y < HEIGHT - 20).toBe(true);
    }
  });

  it('from the front: the robot’s left is at the right, and it comes towards us', () => {
    const made = eye();
    made.look('front', false);
    expect(seen(made, [0, 0.3, 0.7]).x).toBeGreaterThan(WIDTH / 2);
    expect(seen(made, [0.3, 0, 0.7]).away).toBeLessThan(seen(made, [0, 0, 0.7]).away);
  });

  it('stands where its picture says: that point is nowhere to be seen, at no distance', () => {
    const made = eye();
    made.drag(30, 40);
    expect(seen(made, made.position).away).toBeCloseTo(0, 9);
  });

  it('zooms about the pointer: what is under it stays there', () => {
    const made = eye();
    const before = seen(made, [0, 0.2, 0.9]);
    // A point at the distance of the target.
    made.look('side', false);
    const point = [0.2, 0, 0.9] as const;
    const { x, y } = seen(made, point);
    made.zoom(0.5, x, y);
    const after = seen(made, point);
    expect([after.x, after.y]).toEqual([expect.closeTo(x, 0), expect.closeTo(y, 0)]);
    expect(after.away).toBeLessThan(before.away);
  });

  it('pans with the pointer, turns without going under the floor', () => {
    const made = eye();
    made.look('side', false);
    const before = seen(made, [0, 0, 0.7]);
    made.pan(50, -20);
    const after = seen(made, [0, 0, 0.7]);
    expect([after.x - before.x, after.y - before.y]).toEqual([expect.closeTo(50, 6), expect.closeTo(-20, 0)]);
    made.drag(0, -1e5);
    expect(made.position[2]).toBeGreaterThan(0);
    made.drag(0, 1e5);
    expect(seen(made, [0, 0, 0.7]).away).toBeGreaterThan(0);
  });

  it('eases to a view and then rests, and lets go when a hand comes', () => {
    const made = eye();
    made.look('front', true);
    expect(made.moving).toBe(true);
    for (let i = 0; i < 20; i += 1) made.advance(0.016);
    expect(made.moving).toBe(false);
    const there = eye();
    there.look('front', false);
    for (const i of [0, 1, 2]) expect(made.position[i]).toBeCloseTo(there.position[i]!, 9);
    made.look('side', true);
    made.drag(1, 0);
    expect(made.moving).toBe(false);
  });

  it('goes along with a robot that walks away, not with one that sways', () => {
    const made = eye();
    const { x } = made.middle;
    made.follow(0.05, 0);
    expect(made.middle.x).toBe(x);
    made.follow(3, 0);
    expect(Math.abs(made.middle.x - 3)).toBeLessThan(0.5);
  });

  it('comes close to a point, and turns with the robot when asked to', () => {
    const made = eye();
    const far = Math.hypot(...made.position.map((value, i) => value - made.target[i]!));
    made.focus([0.1, 0, 1.2], false);
    expect(made.target).toEqual([0.1, 0, 1.2]);
    expect(seen(made, [0.1, 0, 1.2]).away).toBeLessThan(far / 2);
    made.frame([-0.3, -0.4, 0], [0.3, 0.4, 1.4], false);
    expect(made.target).toEqual([0.1, 0, 1.2]);

    made.followMode = 'turn';
    made.follow(0, 0, 0);
    made.look('front', false);
    made.follow(0, 0, Math.PI / 2);
    expect(made.position[1]).toBeGreaterThan(2); // in front of a robot that faces y
    made.followMode = 'stay';
    const before = made.position;
    made.follow(9, 0, 0);
    expect(made.position).toEqual(before);
  });
});

const [LOW, HIGH]: [Vec3, Vec3] = [
  [-0.15, -0.3, 0],
  [0.2, 0.3, 1.3],
];

function ofHumanoid(options: RigOptions = {}): CameraRig {
  const made = new CameraRig(options);
  made.resize(1000, 800);
  made.frame(LOW, HIGH);
  return made;
}

/** A point in the picture, −1…1 right and up. */
function onScreen(rig: CameraRig, point: Vec3) {
  const { x, y } = seen(rig, point);
  const { width, height } = rig.projection;
  return { x: (2 * x) / width - 1, y: 1 - (2 * y) / height };
}

/** How far the corners of a box extend on the screen: −1…1 is inside. */
function reachOnScreen(rig: CameraRig, low: Vec3, high: Vec3): number {
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) =>
    onScreen(rig, [1, 2, 4].map((bit, axis) => (corner & bit ? high : low)[axis]!) as unknown as Vec3),
  );
  return Math.max(...corners.flatMap(({ x, y }) => [Math.abs(x), Math.abs(y)]));
}

const fromTarget = ({ position, target }: CameraRig) =>
  position.map((value, axis) => value - target[axis]!) as [number, number, number];
const distance = (rig: CameraRig) => Math.hypot(...fromTarget(rig));

describe('the eye of a humanoid', () => {
  it('is first about three metres away, 45° from ahead, Z up, looked at in its middle', () => {
    const rig = ofHumanoid();
    const [x, y, z] = fromTarget(rig);
    expect(distance(rig)).toBeGreaterThan(2.7);
    expect(distance(rig)).toBeLessThan(3.6);
    expect(x).toBeCloseTo(-y, 6);
    expect(z).toBeGreaterThan(0);
    expect(rig.target[2]).toBeCloseTo(0.65, 6);
  });

  it.each([
    ['a desk arm', 0.2, 1.6],
    ['a humanoid on a phone', 1, 0.56],
    ['a giant', 40, 1.6],
  ])('has %s in the picture whole, and not small in it', (_, scale, aspect) => {
    const rig = ofHumanoid();
    const [low, high] = [LOW, HIGH].map((corner) => corner.map((m) => m * scale) as unknown as Vec3);
    rig.resize(800 * aspect, 800);
    rig.frame(low!, high!);
    for (const view of ['home', 'front', 'side', 'top'] as const) {
      rig.look(view, false);
      expect(reachOnScreen(rig, low!, high!)).toBeLessThan(1);
      if (view !== 'top') expect(reachOnScreen(rig, low!, high!)).toBeGreaterThan(0.6);
    }
  });

  it('front looks from ahead, side from its right, top has ahead upwards', () => {
    const rig = ofHumanoid();
    const eyeFrom = (view: 'front' | 'side' | 'top') => {
      rig.look(view, false);
      return fromTarget(rig).map((value) => value / distance(rig));
    };
    expect(eyeFrom('front')[0]).toBeGreaterThan(0.99);
    expect(eyeFrom('side')[1]).toBeLessThan(-0.99);
    expect(eyeFrom('top')[2]).toBeGreaterThan(0.99);
    const [x, y, z] = rig.target;
    const ahead = onScreen(rig, [x + 1, y, z]);
    expect(ahead.y).toBeGreaterThan(0.1);
    expect(Math.abs(ahead.x)).toBeLessThan(1e-3);
  });

  it('turns to a view in a quarter of a second, asks for ticks meanwhile, and then for none', () => {
    const rig = ofHumanoid();
    rig.look('front');
    expect(rig.advance(0.1)).toBe(true);
    expect(rig.advance(0.1)).toBe(true);
    expect(rig.advance(0.1)).toBe(false);
    expect(rig.position[1]).toBeCloseTo(rig.target[1], 6);
  });

  it('with reduced motion a view is there at once', () => {
    const rig = ofHumanoid({ still: () => true });
    rig.look('front');
    expect(rig.position[1]).toBeCloseTo(rig.target[1], 6);
    expect(rig.advance(0.01)).toBe(false);
  });

  it('sway moves nothing, a walk takes the camera along', () => {
    const rig = ofHumanoid();
    const before = rig.position;
    rig.follow(0.05, 0.08);
    expect(rig.position).toEqual(before);
    rig.follow(5, 0);
    expect(rig.position[0] - before[0]).toBeGreaterThan(4.5);
    expect(rig.position[2]).toBe(before[2]);
    expect(rig.target[0]).toBeGreaterThan(4.5);
  });

  it('what lies under notes and buttons is no room for a robot: it stands between them, whole', () => {
    const rig = ofHumanoid();
    const lowest = () => Math.min(...[-0.3, 0.3].map((y) => onScreen(rig, [0.2, y, 0]).y));
    const highest = () => Math.max(...[-0.3, 0.3].map((y) => onScreen(rig, [-0.2, y, 1.3]).y));
    const covered = (above: number, below: number) => {
      rig.cover({ above, below });
      while (rig.advance(1));
    };
    rig.resize(390, 480);
    covered(60, 80);
    expect(lowest()).toBeGreaterThan(-1 + (2 * 80) / 480);
    expect(highest()).toBeLessThan(1 - (2 * 60) / 480);
    const between = lowest();
    covered(0, 0);
    expect(lowest(), 'and lower without').toBeLessThan(between);
  });

  it('what comes to cover the picture pushes the robot gently', () => {
    const rig = ofHumanoid();
    rig.resize(390, 480);
    const { y } = onScreen(rig, [0, 0, 0.6]);
    rig.cover({ above: 100, below: 0 });
    expect(onScreen(rig, [0, 0, 0.6]).y).toBeCloseTo(y, 1);
    expect(rig.advance(0.1), 'on its way').toBe(true);
    expect(rig.advance(1), 'there').toBe(false);
    expect(onScreen(rig, [0, 0, 0.6]).y).toBeLessThan(y - 0.1);
  });

  it('comes close to a point, turns around it, moves, and nears, each within its bounds', () => {
    const rig = ofHumanoid();
    const whole = distance(rig);
    rig.focus([0.1, 0.2, 1.1], false);
    expect(rig.target).toEqual([0.1, 0.2, 1.1]);
    expect(distance(rig)).toBeLessThan(whole / 2);

    const before = rig.position;
    rig.orbit(Math.PI, 0);
    expect(rig.position[0] - rig.target[0]).toBeCloseTo(-(before[0] - rig.target[0]), 6);
    expect(rig.position[2]).toBeCloseTo(before[2], 6);
    rig.orbit(0, -10);
    expect(rig.position[2]).toBeGreaterThan(rig.target[2]); // the floor has no underside

    const near = distance(rig);
    rig.zoom(0.5);
    expect(distance(rig)).toBeCloseTo(near / 2, 6);
    for (let i = 0; i < 40; i += 1) rig.zoom(0.5);
    expect(distance(rig)).toBeGreaterThan(0.05);
    rig.look('home', false);
    expect(distance(rig)).toBeCloseTo(whole, 6);
  });

  it('a chosen point stays in the middle of the robot that walks on, and a frame leaves it alone', () => {
    const rig = ofHumanoid();
    rig.focus([0, 0, 1.2], false);
    rig.frame(LOW, HIGH);
    expect(rig.target[2]).toBe(1.2);
    rig.follow(5, 0);
    expect(rig.target[0]).toBeGreaterThan(4.5);
  });

  it('stays, or turns with the robot, when asked to', () => {
    const rig = ofHumanoid();
    rig.followMode = 'stay';
    const before = rig.position;
    rig.follow(5, 0, 0);
    expect(rig.position).toEqual(before);

    rig.followMode = 'turn';
    rig.follow(0, 0, 3.1);
    rig.look('front', false);
    rig.follow(0, 0, -3.1); // the shorter way round: 0.083 rad on
    const [x, y] = fromTarget(rig);
    expect(Math.atan2(y, x)).toBeCloseTo(2 * Math.PI - 6.2, 6);
  });

  it('stands where another page says, from the floor under the robot, until a hand or a view comes', () => {
    const rig = ofHumanoid();
    expect(rig.stand, 'the first view').toBeNull();
    const place = { position: [2, 1, 1.5], target: [0.1, 0, 0.9] } as const;
    rig.standAt(place);
    rig.frame([0.85, 1.7, 0], [1.2, 2.3, 1.3]); // the target turns out to be elsewhere
    const { position, target } = rig.stand!;
    for (const axis of [0, 1, 2]) {
      expect(position[axis]).toBeCloseTo(place.position[axis]!, 9);
      expect(target[axis]).toBeCloseTo(place.target[axis]!, 9);
    }
    expect(rig.target[1]).toBeCloseTo(2, 9);
    rig.orbit(0.1, 0);
    rig.frame(LOW, HIGH);
    expect(rig.target[1], 'a hand has come').toBeCloseTo(2, 9);
    rig.look('home', false);
    expect(rig.stand).toBeNull();
  });

  it('stands no nearer where a page says so than a hand may come', () => {
    const rig = ofHumanoid({ nearest: 1 / 2 });
    rig.standAt({ position: [0.01, 0, 0.9], target: [0, 0, 0.9] });
    expect(distance(rig)).toBeCloseTo(rig.distances.least, 9);
  });

  it('asks for a picture when it is elsewhere, and only then', () => {
    let pictures = 0;
    const rig = ofHumanoid({ changed: () => (pictures += 1) });
    const asked = (work: () => void) => {
      pictures = 0;
      work();
      return pictures > 0;
    };
    expect(asked(() => rig.follow(0.05, 0.08))).toBe(false);
    expect(asked(() => rig.advance(0.1))).toBe(false);
    expect(asked(() => rig.cover({ above: 0, below: 0 }))).toBe(false);
    expect(asked(() => rig.look('front'))).toBe(true);
    expect(asked(() => rig.advance(0.1))).toBe(true);
    expect(asked(() => rig.follow(5, 0))).toBe(true);
    expect(asked(() => rig.pan(1, 0))).toBe(true);
    expect(asked(() => rig.resize(500, 400))).toBe(true);
  });
});
