import { expect, it } from 'vitest';
import type { Balance, FootBalance } from '../src/twin/balance/balance.ts';
import { BalanceTrack } from '../src/twin/balance/track.ts';

const NO_GAPS = { centreOfMass: null, polygon: null, margin: null, pressure: null, capturePoint: null };

/** A foot at (x, y), turned by `yaw` about the vertical. */
function foot(name: string, bears: boolean | null, x: number, y: number, yaw = 0, tip = 0): FootBalance {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
  const at = (u: number, v: number, z: number) => [x + c * u - s * v, y + s * u + c * v, z] as const;
  const corners = [at(0, 0, 0), at(0.2, 0, tip), at(0.2, 0.1, tip), at(0, 0.1, 0)];
  return { name, link: name, bears, forceN: null, pressure: null, atEdge: false, corners };
}

function balance(x: number, y: number, ...feet: FootBalance[]): Balance {
  return {
    ...{
      massKg: 1,
      centreOfMass: [x, y, 1],
      velocity: null,
      capturePoint: null,
      floorM: 0,
      ground: 'measured',
    },
    ...{ polygon: [], nearestEdge: null, marginM: null, pressure: null, feet, gaps: NO_GAPS },
  };
}

const near = (...values: number[]) => values.map((value) => expect.closeTo(value, 9));

it('by odometry all that was stays where it was', () => {
  const track = new BalanceTrack();
  track.push(balance(0, 0, foot('R', true, 0, 0), foot('L', false, 0, 1)), 0, true);
  track.push(balance(0.1, 0, foot('R', true, 0.001, 0), foot('L', true, 0.3, 1)), 0.1, true);
  track.push(balance(0.2, 0, foot('R', false, 0.1, 0), foot('L', true, 0.3, 1)), 0.2, true);
  expect(track.count).toBe(3);
  expect([...track.points.subarray(0, 9)]).toEqual([0, 0, 0, 0.1, 0, 0, 0.2, 0, 0]);
  const told = track.footprints.map(({ foot: name, corners, fromS, untilS }) => [
    name,
    corners[0]![0],
    fromS,
    untilS,
  ]);
  expect(told).toEqual([
    ['R', 0.001, 0, 0.2],
    ['L', 0.3, 0.1, null],
  ]);
});

it('without odometry what was moves with the foot that stands', () => {
  const track = new BalanceTrack();
  track.push(balance(0, 0, foot('R', true, 0, 0)), 0, false);
  // The scene keeps the robot at its origin: the foot has slid back by 0.1 m and turned by a quarter.
  track.push(balance(0, 0, foot('R', true, -0.1, 0, Math.PI / 2)), 0.1, false);
  expect([...track.points.subarray(0, 3)]).toEqual(near(-0.1, 0, 0));
  track.push(balance(0, 0, foot('R', true, -0.1, 0.2, Math.PI / 2)), 0.2, false);
  expect([...track.points.subarray(0, 6)]).toEqual(near(-0.1, 0.2, 0, 0, 0.2, 0));
});

it('a footprint is where the foot stood flattest', () => {
  const track = new BalanceTrack();
  track.push(balance(0, 0, foot('R', true, 0, 0, 0, 0.02)), 0, true);
  track.push(balance(0, 0, foot('R', true, 0.01, 0)), 0.1, true);
  track.push(balance(0, 0, foot('R', true, 0.02, 0, 0, 0.03)), 0.2, true);
  expect(track.footprints[0]!.corners[0]![0]).toBe(0.01);
});

it('keeps ten seconds, and as many points however many poses come', () => {
  const track = new BalanceTrack();
  for (let i = 0; i <= 4000; i += 1) {
    const down = Math.floor(i / 200) % 2 === 0;
    track.push(balance(i, 0, foot('R', down, 0, 0), foot('L', !down, 0, 1)), i / 200, true);
  }
  expect(track.count).toBeGreaterThan(450);
  expect(track.count).toBeLessThanOrEqual(600);
  expect(track.times[0]).toBeGreaterThanOrEqual(10);
  expect(track.footprints.length).toBeLessThan(13);
  for (const { untilS } of track.footprints) expect(untilS ?? 20).toBeGreaterThanOrEqual(10);
});

it('begins anew after a gap, when time runs back, and where no foot is shared', () => {
  const track = new BalanceTrack();
  const stands = balance(0, 0, foot('R', true, 0, 0));
  for (const [from, to] of [
    [0, 0.8],
    [5, 4],
  ] as const) {
    track.clear();
    track.push(stands, from, true);
    track.push(stands, to, true);
    expect(track.count).toBe(1);
  }
  track.clear();
  track.push(stands, 0, false);
  track.push(balance(0, 0, foot('R', false, 0, 0)), 0.1, false);
  expect([track.count, track.footprints.length]).toEqual([1, 0]);
});

it('leaves out poses in which a foot is unread, and those without a centre or a floor', () => {
  const track = new BalanceTrack();
  track.push(balance(0, 0, foot('R', true, 0, 0)), 0, false);
  track.push(balance(9, 9, foot('R', null, 9, 9)), 0.1, false);
  track.push(balance(0, 0, foot('R', true, 0.1, 0)), 0.2, false);
  expect([...track.points.subarray(0, 3 * track.count)]).toEqual(near(0.1, 0, 0, 0, 0, 0));
  track.push({ ...balance(0, 0, foot('R', true, 0.1, 0)), centreOfMass: null }, 0.3, false);
  track.push({ ...balance(0, 0, foot('R', true, 0.1, 0)), floorM: null }, 0.4, false);
  expect(track.count).toBe(2);
});
