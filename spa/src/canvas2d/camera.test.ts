import { describe, expect, it } from 'vitest';
import { LightCamera } from './camera.ts';

const [WIDTH, HEIGHT] = [800, 600];

function eye(): LightCamera {
  const made = new LightCamera();
  made.resize(WIDTH, HEIGHT);
  made.frame([-0.3, -0.4, 0], [0.3, 0.4, 1.4], false);
  return made;
}

function seen(from: LightCamera, [x, y, z]: readonly [number, number, number]) {
  const m = from.screenFromWorld();
  const row = (r: number) => m[r]! * x + m[r + 1]! * y + m[r + 2]! * z + m[r + 3]!;
  return { x: row(0) / row(8), y: row(4) / row(8), away: row(8) };
}

describe('the eye of the light view', () => {
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
    made.cover({ above: 100, below: 20 }, true);
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
    made.orbit(30, 40);
    expect(seen(made, made.position as [number, number, number]).away).toBeCloseTo(0, 9);
  });

  it('zooms about the pointer: what is under it stays there', () => {
    const made = eye();
    const before = seen(made, [0, 0.2, 0.9]);
    // A point at the distance of what is looked at.
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
    made.orbit(0, -1e5);
    expect(made.position[2]).toBeGreaterThan(0);
    made.orbit(0, 1e5);
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
    made.orbit(1, 0);
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
    expect(made.position[1]).toBeGreaterThan(2); // ahead of a robot that looks to y
    made.followMode = 'stay';
    const before = made.position;
    made.follow(9, 0, 0);
    expect(made.position).toEqual(before);
  });
});
