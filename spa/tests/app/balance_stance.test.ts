import { parseSchema, type Schema, type Threshold } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { briefWords, stanceWords } from '../../src/app/balance/BalanceView.tsx';
import { lackWords } from '../../src/app/robot/SignMenu.tsx';
import { balanceEn } from '../../src/app/text/late_en.ts';
import { balanceKo } from '../../src/app/text/late_ko.ts';
import { BalanceReader } from '../../src/model/balance/balance_reader.ts';
import { readManifest } from '../../src/model/manifest.ts';
import type { Balance, Vec2 } from '../../src/twin/balance/balance.ts';
import { couldStand, lacksOf, toldOfMasses } from '../../src/twin/balance/lacks.ts';
import {
  fallDirection,
  MARGIN,
  marginLimits,
  type Stance,
  StanceJudge,
} from '../../src/twin/balance/stance.ts';
import { ValueLimits, withEdit } from '../../src/twin/limits.ts';
import { quatOfRpy, type Vec3 } from '../../src/twin/rotation.ts';
import { codesWith, SCHEMA, SCHEMA_TEXT } from '../rigs/schema.ts';

/** 20 cm wide and 10 cm deep, about the origin. */
const FEET: readonly Vec2[] = [
  [-0.05, -0.1],
  [0.05, -0.1],
  [0.05, 0.1],
  [-0.05, 0.1],
];
const NO_GAPS = { centreOfMass: null, polygon: null, margin: null, pressure: null, capturePoint: null };

/** A robot on these feet, whose margin is measured to the left edge (y = 0.1). */
function standing(marginMm: number | null, changed: Partial<Balance> = {}): Balance {
  return {
    massKg: 50,
    centreOfMass: marginMm === null ? null : [0, 0.1 - marginMm / 1000, 0.6],
    velocity: null,
    slide: null,
    capturePoint: null,
    floorM: 0,
    ground: 'measured',
    polygon: FEET,
    nearestEdge: 2,
    marginM: marginMm === null ? null : marginMm / 1000,
    pressure: null,
    feet: [],
    gaps: NO_GAPS,
    ...changed,
  };
}

const PAGES = marginLimits(null);

function judged() {
  const judge = new StanceJudge();
  return (marginMm: number | null, changed: Partial<Balance> = {}, limits = PAGES, heading = 0) =>
    judge.next(standing(marginMm, changed), heading, limits);
}

/** A raised foot to the left of the support. */
const RAISED = {
  feet: [
    {
      corners: [
        [-0.05, 0.2, 0.05],
        [0.05, 0.2, 0.05],
        [0.05, 0.4, 0.05],
        [-0.05, 0.4, 0.05],
      ],
    },
  ],
} as unknown as Partial<Balance>;

describe('a step', () => {
  const stepping = (y: number, speed: number) => ({
    feet: [{ corners: FEET.map(([x, side]): Vec3 => [x, side, 0]) }, ...RAISED.feet!] as Balance['feet'],
    capturePoint: [0, y, 0] as Vec3,
    velocity: [0, speed, 0] as Vec3,
  });

  it('is moving while the foot in the air can catch it, and no fall', () => {
    expect(judged()(-30, stepping(0.15, 0.1))).toMatchObject({
      kind: 'moving',
      level: 'caution',
      side: null,
    });
    expect(judged()(-0.5, stepping(0.15, 0.1)), 'on its way out').toMatchObject({
      kind: 'edge',
      level: 'caution',
    });
  });

  it('is none past that foot, to the other side, or while it hardly moves', () => {
    expect(judged()(-30, stepping(0.45, 0.8))?.kind).toBe('outside');
    expect(judged()(-30, stepping(-0.2, -0.8))?.kind).toBe('outside');
    expect(judged()(-30, stepping(0.15, 0.01))).toMatchObject({ kind: 'outside', level: 'fault' });
    expect(judged()(-0.5, stepping(0.15, 0.01)), 'at the edge').toMatchObject({
      kind: 'edge',
      level: 'fault',
    });
  });
});

const limitsOf = (threshold: Threshold) =>
  marginLimits(new ValueLimits(SCHEMA.mapping, withEdit(new Map(), MARGIN.field, MARGIN.label, threshold)));

describe('levels', () => {
  it('are amber below 20 mm and red outside, where nobody has set limits', () => {
    const look = judged();
    expect([60, 21, 19, 5].map((mm) => look(mm)?.level)).toEqual(['ok', 'ok', 'caution', 'caution']);
    expect(look(-3)).toMatchObject({ kind: 'outside', level: 'fault', side: 'left' });
  });

  it('do not flicker at a limit: they rise at once and fall when the margin is well back', () => {
    const look = judged();
    expect([20.5, 19.5, 20.5, 21.5, 22.5].map((mm) => look(mm)?.level)).toEqual([
      'ok',
      'caution',
      'caution',
      'caution',
      'ok',
    ]);
    expect([-2, 1.5, 2.5, -2].map((mm) => look(mm)?.level)).toEqual(['fault', 'fault', 'caution', 'fault']);
    expect(look(80)?.level, 'from red to green at once when it is far back').toBe('ok');
  });

  it('are by the profile’s limit, or the viewer’s, in mm', () => {
    const limits = limitsOf({ low: 10, high: null, caution: 0.4 });
    expect(limits.owner).toBe('viewer');
    const look = judged();
    expect([30, 24, 9, 5].map((mm) => look(mm, {}, limits)?.level)).toEqual([
      'ok',
      'caution',
      'fault',
      'fault',
    ]);
    const doc = JSON.parse(SCHEMA_TEXT);
    doc.mapping.thresholds.balance = { margin: { low: 10, caution: 0.4 } };
    const profile = marginLimits(new ValueLimits(parseSchema(JSON.stringify(doc)).mapping));
    expect(profile).toMatchObject({ owner: 'profile', threshold: { low: 10 } });
    expect(marginLimits(new ValueLimits(SCHEMA.mapping)).owner).toBe('page');
  });

  it('a new limit judges anew: nothing lingers of the one before', () => {
    const look = judged();
    expect(look(19)?.level).toBe('caution');
    expect(look(21)?.level).toBe('caution');
    expect(look(21, {}, limitsOf({ low: 10, high: null, caution: 1 }))?.level).toBe('ok');
  });
});

describe('what is said', () => {
  it('inside, over the edge, outside: never both in turns where the value trembles about 0', () => {
    const look = judged();
    const kinds = [5, 0.8, -0.8, 2.5, -2.5, 3.5, 0.5, -3.5].map((mm) => look(mm)?.kind);
    expect(kinds).toEqual(['inside', 'edge', 'edge', 'edge', 'edge', 'inside', 'edge', 'outside']);
  });

  it('outside, but it would come to rest over its feet: moving, and no fault by the page’s own limit', () => {
    const look = judged();
    const rest = { capturePoint: [0, 0.05, 0] as Vec3 };
    expect(look(-20, rest)).toMatchObject({ kind: 'moving', level: 'caution', side: null });
    expect(look(-20, { capturePoint: [0, 0.2, 0] })).toMatchObject({ kind: 'outside', level: 'fault' });
    expect(look(-20, { capturePoint: [0, 0.098, 0] })?.kind, 'hardly inside').toBe('outside');
    look(-20, rest);
    expect(look(-20, { capturePoint: [0, 0.098, 0] })?.kind, 'still inside').toBe('moving');
    const own = limitsOf({ low: 0.5, high: null, caution: 1 });
    expect(look(-20, rest, own)?.level, 'a limit that somebody set is about the margin').toBe('fault');
  });

  it('nothing of an arm; that no foot bears, or that one is not read', () => {
    const gaps = (polygon: Balance['gaps']['polygon']) => ({
      gaps: { ...NO_GAPS, polygon, margin: polygon },
    });
    const look = judged();
    expect(look(null, { ground: null, ...gaps('no-feet') })).toBeNull();
    expect(look(null, gaps('old-bundle'))).toBeNull();
    expect(look(null, { gaps: { ...NO_GAPS, margin: 'no-masses' } })).toBeNull();
    expect(look(null, gaps('airborne'))).toMatchObject({ kind: 'airborne', level: 'ok', marginMm: null });
    expect(look(null, gaps('unread'))?.kind).toBe('unread');
    expect(look(null, gaps('orientation-unread'))?.kind).toBe('orientation-unread');
    expect(look(null, gaps('joint-unread'))?.kind).toBe('joint-unread');
  });

  const stance = (changed: Partial<Stance>): Stance => ({
    kind: 'inside',
    level: 'ok',
    marginMm: 31.4,
    side: null,
    assumed: false,
    ...changed,
  });
  const said = (changed: Partial<Stance>, was = false) =>
    stanceWords(stance(changed), was, balanceEn).replaceAll('\u00a0', ' ');

  it('is one sentence, in the past tense of what is old', () => {
    expect(said({})).toBe('The centre of mass is 31 mm inside the area it stands on.');
    expect(said({}, true)).toBe('The centre of mass was 31 mm inside the area it stood on.');
    expect(said({ kind: 'outside', marginMm: -12, side: 'left' })).toBe(
      'It would fall to its left: the centre of mass is 12 mm outside.',
    );
    expect(said({ kind: 'outside', marginMm: -12, side: 'forwards' })).toMatch(/^It would fall forwards:/);
    expect(said({ kind: 'outside', marginMm: -12, side: 'left' }, true)).toMatch(/was 12 mm outside/);
    expect(said({ kind: 'moving', marginMm: -12 })).toMatch(
      /^It is moving: .* come to rest over its feet\.$/,
    );
    expect(said({ kind: 'moving', marginMm: -12 }, true), 'why it was no fault').toBe(
      'It was moving: the centre of mass was 12 mm outside, but it would have come to rest over its feet.',
    );
    expect(balanceKo.wasMoving('12 mm')).toMatch(/움직이는 중이었습니다: .*12 mm/);
    expect(said({ assumed: true })).toMatch(/inside .* Assumed: .* No sensor measures it\.$/);
    expect(said({ kind: 'airborne', marginMm: null, assumed: true })).toBe('No foot bears weight.');
    expect(said({ kind: 'unread', marginMm: null }, true)).toBe('');
    expect(said({ kind: 'orientation-unread', marginMm: null, assumed: true })).toBe(
      'Its body’s orientation has no reading, so the page can’t tell how it stands.',
    );
  });

  it('beside others in two or three words, and silent of what is old', () => {
    const brief = (changed: Partial<Stance>, was = false) => briefWords(stance(changed), was, balanceEn);
    expect(brief({})).toBe('31\u00a0mm inside');
    expect(brief({ kind: 'outside', marginMm: -12 })).toBe('12\u00a0mm outside');
    expect(brief({}, true)).toBe('');
    for (const kind of [
      'edge',
      'moving',
      'airborne',
      'unread',
      'orientation-unread',
      'joint-unread',
    ] as const)
      expect(brief({ kind })).not.toBe('');
  });
});

describe('the direction', () => {
  const at = (x: number, y: number, nearestEdge: number) => ({
    centreOfMass: [x, y, 0.6] as Vec3,
    polygon: FEET,
    nearestEdge,
  });

  it('is by the robot’s own heading', () => {
    expect(fallDirection(at(0.08, 0, 1), 0, null)).toBe('forwards');
    expect(fallDirection(at(-0.08, 0, 3), 0, null)).toBe('backwards');
    expect(fallDirection(at(0, 0.12, 2), 0, null)).toBe('left');
    expect(fallDirection(at(0, -0.12, 0), 0, null)).toBe('right');
    expect(fallDirection(at(0.08, 0, 1), Math.PI / 2, null)).toBe('right');
    expect(fallDirection(at(0.08, 0, 1), Math.PI, null)).toBe('backwards');
    expect(fallDirection({ ...at(0, 0, 0), nearestEdge: null }, 0, null)).toBeNull();
  });

  it('stays what was said where it is nearly between two', () => {
    const corner = at(0.05 + 0.01, 0.1 + 0.011, 1);
    expect(fallDirection(corner, 0, null)).toBe('left');
    expect(fallDirection(corner, 0, 'forwards')).toBe('forwards');
    expect(fallDirection(at(0.05 + 0.01, 0.1 + 0.02, 1), 0, 'forwards')).toBe('left');
  });

  it('the heading is the odometry’s, else the body sensor’s, else along x', () => {
    const turned = quatOfRpy([0, 0, 1.2]).map((part) => Math.round(part * 1000));
    const of = (quat: readonly number[]) =>
      Object.fromEntries(['w', 'x', 'y', 'z'].map((part, i) => [`quat.torso.${part}`, quat[i]!]));
    const doc = JSON.parse(SCHEMA_TEXT);
    doc.mapping.sensors.torso = { kind: 'imu', name: 'chest', link: 'torso' };
    const withImu = parseSchema(JSON.stringify(doc));
    const manifest = readManifest({ v: 2, links: ['torso'], joints: [], levels: [], visuals: [] });
    const heading = (schema: Schema, readings: Record<string, number | null>) => {
      const reader = new BalanceReader(manifest, schema);
      reader.ofFrame(codesWith(readings), 0);
      return reader.headingRad;
    };
    expect(heading(withImu, of(turned))).toBeCloseTo(1.2, 2);
    expect(heading(SCHEMA, of(turned)), 'nobody says whose it is').toBe(0);
    expect(heading(withImu, { 'quat.torso.w': null }), 'no reading').toBe(0);
  });
});

describe('what can’t be known', () => {
  const gaps = (centreOfMass: Balance['gaps']['centreOfMass'], polygon: Balance['gaps']['polygon']) => ({
    gaps: { ...NO_GAPS, centreOfMass, polygon },
  });
  const lines = (found: ReturnType<typeof lacksOf>) => found.map((lack) => lackWords(lack, balanceEn));

  it('is said once each, with what the doctor found', () => {
    expect(lacksOf(gaps(null, null), [])).toEqual([]);
    const old = lacksOf(gaps('old-bundle', 'old-bundle'), []);
    expect(lines(old)).toEqual(['This model was built without masses. Build it again.']);
    expect(lines(lacksOf(gaps('no-masses', 'no-feet'), []))).toEqual([
      'The robot’s description has no masses.',
      'This robot has no known feet, like an arm, wheels or a stand. Name its feet under [balance] in the profile.',
    ]);
    const findings = [null, { code: 7 }, { code: 'mass-negative', text: 'link head: \u202emass -3 kg' }];
    const bad = lacksOf(gaps('impossible-masses', null), toldOfMasses(findings));
    expect(lines(bad)).toEqual(['link head: \\u{202e}mass -3 kg']);
    expect(lines(lacksOf(gaps('impossible-masses', null), toldOfMasses('nonsense')))).toEqual([
      balanceEn.impossibleMasses,
    ]);
    expect(lines(lacksOf(gaps(null, null), [], ['soles[0]: its link does not exist']))).toEqual([
      'soles[0]: its link does not exist',
    ]);
  });

  it('is said of feet that measure too little: first of what bears, else of the pressure', () => {
    const told = (polygon: Balance['gaps']['polygon']) =>
      lines(lacksOf({ gaps: { ...NO_GAPS, polygon, pressure: 'no-wrench' } }, []));
    expect(told(null)).toEqual([
      'No centre of pressure: not every foot measures its force and moments (Fz, Mx, My).',
    ]);
    expect(told('airborne')).toEqual(told(null));
    expect(told('no-wrench')).toEqual([
      'The page can’t tell which feet bear weight: not every foot measures its force (Fz).',
    ]);
    expect(lackWords({ why: 'no-pressure' }, balanceKo)).toContain('Fz, Mx, My');
  });

  it('passes with time: no foot bears, one is not read', () => {
    expect(lacksOf(gaps(null, 'airborne'), [])).toEqual([]);
    expect(lacksOf(gaps(null, 'unread'), [])).toEqual([]);
    expect(lacksOf(gaps('joint-unread', 'joint-unread'), [])).toEqual([{ why: 'joint-unread' }]);
    expect(lacksOf(gaps('orientation-unread', 'orientation-unread'), [])).toEqual([
      { why: 'orientation-unread' },
    ]);
    expect(lackWords({ why: 'raw' }, balanceEn)).toBe(balanceEn.rawModel);
  });

  it('without two force sensors on links nothing is loaded for it', () => {
    expect(couldStand(null)).toBe(false);
    expect(couldStand(SCHEMA), 'one foot').toBe(false);
    const doc = JSON.parse(SCHEMA_TEXT);
    doc.mapping.sensors.LF = { kind: 'wrench', name: 'left foot', link: 'foot_left' };
    expect(couldStand(parseSchema(JSON.stringify(doc)))).toBe(true);
  });
});
