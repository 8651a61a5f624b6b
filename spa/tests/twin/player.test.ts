import { describe, expect, it } from 'vitest';
import { Player } from '../../src/twin/playback/player.ts';
import { ImuTable } from '../../src/twin/sensors/imus.ts';
import { positionOf } from '../rigs/joints.ts';
import { BASE_FIELDS, BASE_LABELS, codesWith, SCHEMA, schemaWith, stateAt } from '../rigs/schema.ts';

const state = (seq: number, codes: Int32Array) => stateAt(seq * 100 + 40, codes, { seq, tS: seq / 10 });

/** A player that has received ten frames of LKN, with RKN increasing by 0.1 rad each time. */
function moving(): Player {
  const player = new Player(SCHEMA);
  for (let i = 0; i < 10; i += 1) {
    player.push(state(i, codesWith({ 'pos.LKN': i * 100, 'pos.RKN': i * 100, 'ref.RKN': i * 200 })));
  }
  return player;
}

const END = 10_000;

describe('what is shown of a robot', () => {
  it('moves between two frames, pos and ref and couplings alike, and ends at the newest', () => {
    const player = moving();
    const between = 9 * 100 + 40 + player.delayMs - 50;
    expect(player.sample(between)).toBe(true);
    const part = positionOf(player.pose('pos').joints, 'RKN')!;
    expect(part).toBeGreaterThan(0.8);
    expect(part).toBeLessThan(0.9);
    expect(positionOf(player.pose('pos').joints, 'knee_left')).toBeCloseTo(2 * part + 0.5, 9);
    expect(positionOf(player.pose('ref').joints, 'RKN')).toBeCloseTo(2 * part, 9);
    expect(player.sample(END)).toBe(false);
    expect(positionOf(player.pose('pos').joints, 'RKN')).toBeCloseTo(0.9);
  });

  it('its time and what presses on it are those of the pose between two frames', () => {
    const player = new Player(SCHEMA);
    for (let i = 0; i < 10; i += 1) {
      player.push(state(i, codesWith({ 'pos.RKN': i * 100, 'ftf.RF.fz': i * 50 })));
    }
    player.sample(9 * 100 + 40 + player.delayMs - 50);
    const { joints, tS, wrenches } = player.pose('pos');
    const part = positionOf(joints, 'RKN')!;
    expect(part).toBeGreaterThan(0.8);
    expect(tS).toBeCloseTo(part, 2);
    expect(wrenches).toEqual([
      {
        site: 'RF',
        force: { vector: [0, 0, expect.closeTo(part * 500)], axes: [2] },
        moment: { vector: [0, 0, 0], axes: [0, 1] },
      },
    ]);
    player.sample(END);
    expect(player.pose('pos').tS).toBeCloseTo(0.9);
  });

  it('a force that loses its reading is none at once; it is not played on', () => {
    const player = new Player(SCHEMA);
    player.push(state(0, codesWith({ 'ftf.RF.fz': 200 })));
    player.push(state(1, codesWith({ 'ftf.RF.fz': null })));
    player.sample(END);
    expect(player.pose('pos').wrenches?.[0]?.force).toEqual({ vector: null, axes: [2] });
    expect(player.pose('pos').wrenches?.[0]?.moment.vector).toEqual([0, 0, 0]);
  });

  it('the time of a robot that stands still goes on', () => {
    const player = moving();
    player.sample(END);
    for (const seq of [110, 115]) {
      player.push(state(seq, codesWith({ 'pos.LKN': 900, 'pos.RKN': 900, 'ref.RKN': 1800 })));
      player.sample(seq * 100 + 500);
      expect(player.pose('pos').tS).toBe(seq / 10);
    }
  });

  it('a joint that loses its reading keeps its last true angle, and is named', () => {
    const player = moving();
    expect(player.push(state(10, codesWith({ 'pos.LKN': 1000, 'pos.RKN': null })))).toBe(true);
    player.sample(END);
    const { joints, unread } = player.pose('pos');
    expect(positionOf(joints, 'RKN')).toBeCloseTo(0.9);
    expect(positionOf(joints, 'LKN')).toBeCloseTo(1);
    expect([...(unread ?? [])]).toEqual(['RKN']);
    player.push(state(11, codesWith({ 'pos.LKN': 1000, 'pos.RKN': 950 })));
    player.sample(2 * END);
    expect(player.pose('pos').unread?.size).toBe(0);
    expect(positionOf(player.pose('pos').joints, 'RKN')).toBeCloseTo(0.95);
  });

  it('a joint without any reading yet has no angle', () => {
    const player = new Player(SCHEMA);
    player.push(state(0, codesWith({ 'pos.NK1': null })));
    expect(positionOf(player.pose('pos').joints, 'NK1')).toBeNaN();
  });

  it('angles far out of every limit are shown as they are', () => {
    const player = moving();
    player.push(state(10, codesWith({ 'pos.RKN': 100_000_000 })));
    player.sample(END);
    expect(positionOf(player.pose('pos').joints, 'RKN')).toBeCloseTo(100_000);
  });

  it('an orientation of length zero is none: the last one stays', () => {
    const player = new Player(SCHEMA);
    const imu = new ImuTable(SCHEMA).imus[0]!;
    player.push(state(0, codesWith({ 'quat.torso.w': 0, 'quat.torso.x': 1000 })));
    expect(player.worldFromSensor(imu)).toEqual([0, 1, 0, 0]);
    player.push(state(1, codesWith({ 'quat.torso.w': 0 })));
    player.sample(END);
    expect(player.worldFromSensor(imu)).toEqual([0, 1, 0, 0]);
  });

  it('raw shows every frame when it comes', () => {
    const player = moving();
    player.raw = true;
    expect(positionOf(player.pose('pos').joints, 'RKN')).toBeCloseTo(0.9);
    player.push(state(10, codesWith({ 'pos.RKN': 1000 })));
    expect(positionOf(player.pose('pos').joints, 'RKN')).toBeCloseTo(1);
    expect([player.delayMs, player.sample(10 * 100 + 41)]).toEqual([0, false]);
  });

  it('a joint that turns on goes the shorter way, when the model says that it does', () => {
    for (const [names, way] of [
      [['RKN'], Math.PI],
      [[], 0],
    ] as const) {
      const player = new Player(SCHEMA);
      player.setContinuous(names);
      for (let i = 0; i < 10; i += 1) player.push(state(i, codesWith({ 'pos.RKN': 3100, 'pos.LKN': i })));
      player.push(state(10, codesWith({ 'pos.RKN': -3100, 'pos.LKN': 10 })));
      player.sample(10 * 100 + 40 + player.delayMs - 50);
      expect(Math.abs(Math.abs(positionOf(player.pose('pos').joints, 'RKN')!) - way)).toBeLessThan(0.2);
    }
  });
});

describe('a base by odometry', () => {
  const floating = schemaWith(BASE_LABELS, BASE_FIELDS);
  const at = (...codes: number[]) => Int32Array.from(codes);

  it('moves in a line and turns the shorter way; one that is no rotation is no report', () => {
    const player = new Player(floating);
    expect(player.pose('pos').base).toBeNull();
    player.push(state(0, at(0, 0, 0, 1000, 0, 0, 0)));
    player.push(state(1, at(100, 0, 0, -1000, 0, 0, 0)));
    player.sample(END);
    expect(player.pose('pos').unturned).toBe(false);
    expect(player.push(state(2, at(500, 0, 0, 0, 0, 0, 0)))).toBe(true);
    expect(player.pose('pos').unturned, 'its last turn is shown, and known to be old').toBe(true);
    player.sample(2 * END);
    const { xyz, quat_wxyz } = player.pose('pos').base!;
    expect(xyz[0]).toBeCloseTo(0.1);
    expect(Math.abs(quat_wxyz[0])).toBeCloseTo(1);
  });
});
