import type { Level } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { AttitudeOverlay } from '../../../src/scene/signs/attitude.ts';
import { levelColor, loadColor, OVERLAY_COLORS } from '../../../src/scene/signs/colors.ts';
import { DeviationOverlay } from '../../../src/scene/signs/deviations.ts';
import { JointLoadPaint } from '../../../src/scene/signs/joint_load.ts';
import { AT, MOST_STROKES, STRIDE, Strokes } from '../../../src/scene/signs/strokes.ts';
import { WrenchOverlay } from '../../../src/scene/signs/wrenches.ts';
import { OverlayMesh } from '../../../src/scene/three/overlay_mesh.ts';
import type { Deviation } from '../../../src/twin/overlay/deviations.ts';
import { type Quat, quatOfRpy, type Vec3 } from '../../../src/twin/rotation.ts';
import type { Imu } from '../../../src/twin/sensors/imus.ts';
import type { Arrow, Wrench } from '../../../src/twin/sensors/wrenches.ts';
import { sampleLeg } from '../../rigs/leg_sample.ts';

const GREEN = { color: 0x00ff00 };
const GREY = { color: 0x000000 };
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

  it('know when they are the picture before', () => {
    const strokes = new Strokes();
    const again = (length: number) => {
      strokes.begin();
      strokes.shaft(ORIGIN, UP, length, 0.1, 0.1, GREEN);
      strokes.fan(ORIGIN, UP, [1, 0, 0], 1, 0, 1, { ...GREEN, opacity: 0.3 });
      return strokes.end();
    };
    expect([again(1), again(1), again(2), again(2)]).toEqual([true, false, true, false]);
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

  it('beyond their room are left out', () => {
    const strokes = drawn((s) => {
      for (let i = 0; i < MOST_STROKES + 10; i += 1) s.shaft(ORIGIN, UP, i, 0.1, 0.1, GREEN);
    });
    expect(strokes.count).toBe(MOST_STROKES);
  });
});

function wrench(force: Partial<Arrow>, moment: Partial<Arrow> = {}): Wrench {
  const arrow = (given: Partial<Arrow>, much: number): Arrow => ({
    ...{ vector: [0, 0, 0], level: 'ok', axes: [0, 1, 2], much },
    ...given,
  });
  const mount = { kind: 'wrench', name: 'foot', link: 'foot', xyz: [0, 0, 0], rpy: [0, 0, 0] } as const;
  return { site: 'F', name: 'foot', mount, force: arrow(force, 500), moment: arrow(moment, 10) };
}

function show(of: Wrench, scale = 1, signs = new WrenchOverlay(), feet: readonly { name: string }[] = []) {
  signs.take([of], true);
  const strokes = drawn((b) => signs.draw(b, sampleLeg(), 0.5, scale, () => GREEN, GREY, feet));
  return {
    ...signs.shown[0]!,
    strokes: strokes.count,
    flange: [...strokes.numbers.subarray(AT.tint, AT.tint + 3)],
  };
}

describe('force and moment', () => {
  it('are as long as they are large, and as the viewer wants them', () => {
    const one = show(wrench({ vector: [0, 0, 100] }));
    expect(show(wrench({ vector: [0, 0, 200] })).force!.size).toBeCloseTo(2 * one.force!.size);
    expect(show(wrench({ vector: [0, 0, 100] }), 2).force!.size).toBeCloseTo(2 * one.force!.size);
    expect(one.tip[2] - one.force!.size).toBeCloseTo(0.05, 6); // from the foot's link, which sits at 0.05 m
    expect(show(wrench({ vector: [0, 0, -100] })).tip[2]).toBeLessThan(0.05);
  });

  it('sweep an arc as far as the moment is large, never a whole turn', () => {
    const sweep = (my: number) => show(wrench({}, { vector: [0, my, 0] })).moment!.size;
    expect(sweep(4)).toBeCloseTo(2 * sweep(2));
    expect(sweep(1000)).toBeLessThan(2 * Math.PI);
  });

  it('have more heads the worse it is: colour is not the only sign', () => {
    const strokes = (level: Level) => show(wrench({ vector: [0, 0, 300], level })).strokes;
    expect(strokes('caution')).toBe(strokes('ok') + 1);
    expect(strokes('fault')).toBe(strokes('ok') + 2);
  });

  it('leave the sensor’s place alone when there is nothing to show, and no arrow where there is no reading', () => {
    expect(show(wrench({ vector: [0, 0, 2] })).strokes).toBe(1);
    const unread = show(wrench({ vector: null }));
    expect(unread).toMatchObject({ strokes: 1, force: { value: null, size: 0 } });
    expect(unread.flange, 'green would say that all is well').toEqual([0, 0, 0]);
    expect(
      show(wrench({ vector: null, level: 'fault' })).flange,
      'one axis reads, and is too much',
    ).not.toEqual([0, 0, 0]);
  });

  it('has no ring where balance marks the foot, but one that reads nothing is marked', () => {
    const strokes = (vector: Vec3 | null, feet: string[]) =>
      show(
        wrench({ vector }),
        1,
        new WrenchOverlay(),
        feet.map((name) => ({ name })),
      ).strokes;
    expect(strokes([0, 0, 2], ['LF', wrench({}).site])).toBe(0);
    expect(strokes([0, 0, 2], ['another'])).toBe(1);
    expect(strokes(null, [wrench({}).site])).toBe(1);
  });

  it('glide to a new length within half a second, and come to rest', () => {
    const signs = new WrenchOverlay();
    signs.take([wrench({ vector: [0, 0, 500] })], false);
    let ticks = 0;
    while (signs.advance(1 / 60)) ticks += 1;
    expect(ticks).toBeGreaterThan(5);
    expect(ticks).toBeLessThan(60);
    expect(signs.advance(1 / 60)).toBe(false);
  });

  it('are signed where one axis is measured, and sums where more are', () => {
    expect(show(wrench({ vector: [0, 0, -28], axes: [2] })).force!.value).toBe(-28);
    expect(show(wrench({ vector: [3, 0, 4] })).force!.value).toBe(5);
  });
});

function deviation(joint: string, pos: number, ref: number): Deviation {
  return {
    ...{ channel: 'KN', name: 'knee', error: ref - pos, unit: 'rad', compliant: false },
    joints: [{ joint, pos, ref }],
  };
}

describe('a deviation', () => {
  const signs = new DeviationOverlay();
  const at = (found: Deviation) => {
    const strokes = drawn((b) =>
      signs.draw(b, sampleLeg(), [found], 'pos', 0.5, () => ({
        line: GREEN,
        fill: { ...GREEN, opacity: 0.3 },
      })),
    );
    return { at: signs.shown[0]!.at, strokes: strokes.count };
  };

  it('is an arc about the joint, from where the limb is towards where it should be', () => {
    const bent = at(deviation('knee', 0, 0.4)).at!; // a turn about y takes the hanging shank to −x
    expect(bent[0]).toBeLessThan(-0.01);
    expect(bent[1]).toBeCloseTo(0);
    expect(bent[2]).toBeLessThan(0.5);
    expect(at(deviation('knee', 0.4, 0)).at![0]).toBeGreaterThan(0.01);
  });

  it('of a joint that the model does not have, or that is no number, is not drawn', () => {
    expect(at(deviation('elbow', 0, 1))).toEqual({ at: null, strokes: 0 });
    expect(at(deviation('knee', Number.NaN, 1))).toEqual({ at: null, strokes: 0 });
  });
});

describe('what is level', () => {
  const paints = { plane: GREEN, rim: GREEN, gravity: GREEN, faint: GREEN, lean: GREEN };
  const imu = (site: string, link: string, worldFromSensor: Quat | null): Imu => ({
    ...{
      site,
      name: site,
      link,
      linkFromSensor: [1, 0, 0, 0],
      xyz: [0, 0, 0],
      heading: true,
      worldFromSensor,
    },
  });
  const level = (imus: readonly Imu[], body: Imu | null, based = false, ground = true) => {
    const signs = new AttitudeOverlay();
    const strokes = drawn((b) => signs.draw(b, sampleLeg(), imus, body, based, 0.5, { ...paints, ground }));
    return { ...signs.shown, strokes: strokes.count };
  };

  it('is a plane at the lowest foot, with roll and pitch of the body and the feet’s own rings', () => {
    const body = imu('torso', 'hip', quatOfRpy([0.1, -0.2, 0.5]));
    const shown = level([body, imu('LF', 'foot', quatOfRpy([0, 0, 0]))], body);
    expect(shown.planeZ).toBeCloseTo(0);
    expect(shown.roll).toBeCloseTo(0.1);
    expect(shown.pitch).toBeCloseTo(-0.2);
    expect(shown.feet).toEqual(['LF']);
  });

  it('has neither plane nor plumb line beside the signs of balance: no circle under the robot that it does not stand on', () => {
    const body = imu('torso', 'hip', quatOfRpy([0.1, -0.2, 0.5]));
    const [alone, beside] = [level([body], body), level([body], body, false, false)];
    expect(beside.planeZ, 'its height is known').toBe(alone.planeZ);
    expect(alone.strokes, 'fan, rim, four ticks; shaft, head, thread and foot').toBe(10);
    expect(beside.strokes).toBe(0);
  });

  it('is unknown for a robot without IMU and base: nothing is drawn', () => {
    expect(level([], null)).toEqual({ planeZ: null, roll: null, pitch: null, feet: [], strokes: 0 });
    const dead = imu('torso', 'hip', null);
    expect(level([dead], dead)).toMatchObject({ planeZ: null, roll: null, strokes: 0 });
    expect(level([dead], dead, true).planeZ, 'but the base says it').toBeCloseTo(0);
  });
});

describe('load', () => {
  it('paints what a joint moves, and what hangs on that; past the limit hatched', () => {
    const leg = sampleLeg();
    const tints = new Map<string, unknown>();
    leg.setTint = (link, tint) => void tints.set(link, tint);
    const paint = new JointLoadPaint();
    const loads = new Map([['knee', { part: 1, level: 'fault' as Level }]]);
    expect(paint.paint(leg, loads, 0xff0000)).toBe(true);
    expect(tints.get('shank')).toEqual({ color: 0xff0000, hatched: true });
    expect(tints.get('foot'), 'fixed to the shank').toEqual({ color: 0xff0000, hatched: true });
    expect(tints.get('thigh'), 'no reading').toEqual({ color: 0x7f8894, hatched: false });
    expect(paint.paint(leg, loads, 0xff0000), 'the same again').toBe(false);
    expect(paint.paint(leg, null, 0xff0000)).toBe(true);
    expect(tints.get('shank')).toBeNull();
  });

  it('gets darker all the way, so that an eye without colours sees the order', () => {
    const luma = (hex: number) => 0.2126 * (hex >> 16) + 0.7152 * ((hex >> 8) & 255) + 0.0722 * (hex & 255);
    const steps = Array.from({ length: 21 }, (_, i) => luma(loadColor(i / 20)));
    expect(steps.every((bright, i) => i === 0 || bright < steps[i - 1]!)).toBe(true);
    expect(loadColor(-1)).toBe(loadColor(0));
    expect(loadColor(2)).toBe(loadColor(1));
  });
});

it('signs are grey when the picture is old, and have other colours for colour-blind eyes', () => {
  const { dark, light } = OVERLAY_COLORS;
  expect(levelColor(dark, 'standard', 'fault', false)).toBe(dark.stale);
  expect(levelColor(dark, 'standard', 'fault', true)).toBe(dark.fault);
  expect(levelColor(dark, 'safe', 'caution', true)).toBe(0xf0e442);
  expect(levelColor(light, 'safe', 'caution', true)).toBe(0xe69f00);
});
