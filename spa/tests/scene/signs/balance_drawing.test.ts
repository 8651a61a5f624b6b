import { expect, it } from 'vitest';
import { BalanceReader } from '../../../src/model/balance/balance_reader.ts';
import type { PosedBody } from '../../../src/model/posed_body.ts';
import { BalanceDrawing, type BalanceReadings } from '../../../src/scene/signs/balance_drawing.ts';
import type { Facets } from '../../../src/scene/signs/strokes.ts';
import { limitsBy, marginLimits, StanceJudge } from '../../../src/twin/balance/stance.ts';

import type { Pose } from '../../../src/twin/playback/pose.ts';
import { NO_JOINTS } from '../../../src/twin/playback/pose.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';
import { sampleLeg } from '../../rigs/leg_sample.ts';
import { legSchema, signFrame, signPicture } from '../../rigs/signs.ts';

const SCHEMA = legSchema({ mapping: { balance: { feet: ['F'], ground: 'measured' } } });
const READINGS: BalanceReadings = {
  ...{ schema: SCHEMA, choice: 'on', limits: null, joints: [], anchored: true, lead: null },
};

/** A leg of 40 kg whose mass is `aside` from the middle of its foot, m; the foot is 250 mm long and 100 mm wide. */
function leg({ aside = 0, masses = true } = {}): PosedBody & ReturnType<typeof sampleLeg> {
  const body = sampleLeg();
  const inertia = [1, 0, 0, 1, 0, 1];
  const points: Vec3[] = [
    [-0.1, -0.05, -0.05],
    [0.15, -0.05, -0.05],
    [0.15, 0.05, -0.05],
    [-0.1, 0.05, -0.05],
  ];
  const raw = {
    inertials: masses ? [{ link: 1, mass_kg: 40, xyz: [0, aside, -0.1], inertia }] : [],
    soles: [{ link: 3, points }],
  };
  Object.assign(body.manifest, { raw });
  return body;
}

/** A pose with this upward force (N) on the foot; null: no reading. */
function pose(fz: number | null, tS = 1, my = 0): Pose {
  const axes = [0, 1, 2];
  const force = { vector: fz === null ? null : ([0, 0, fz] as Vec3), axes };
  const moment = { vector: fz === null ? null : ([0, my, 0] as Vec3), axes };
  return { joints: NO_JOINTS, base: null, tS, wrenches: [{ site: 'F', force, moment }] };
}

/** Draws one picture of a robot's balance. */
function draw(
  signs: BalanceDrawing,
  body: PosedBody,
  shownPose: Pose | null,
  readings: Partial<BalanceReadings> = {},
  given: Parameters<typeof signFrame>[1] = {},
): Facets {
  const picture = signPicture(signFrame({}, given), { body, pose: shownPose });
  const facets = picture.facets!;
  facets.begin();
  signs.draw(picture, facets, { ...READINGS, ...readings });
  facets.end();
  return facets;
}

function drawn(
  ...[body, shownPose, ...given]: Parameters<typeof draw> extends [unknown, ...infer R] ? R : never
) {
  const signs = new BalanceDrawing();
  const { count } = draw(signs, body, shownPose, ...given);
  return { ...signs.shown, count, labels: signs.labels };
}

it('shows the mass, what holds it and how much is left, with the number at the nearest edge', () => {
  const shown = drawn(leg({ aside: 0.02 }), pose(392));
  expect(shown.centreOfMass?.[2]).toBeCloseTo(0.9);
  expect(shown.floorM).toBeCloseTo(0);
  expect(shown.polygon?.length).toBe(4);
  expect(shown.marginM).toBeCloseTo(0.03);
  expect(shown.level).toBe('ok');
  expect(shown.feet).toMatchObject([{ name: 'F', bears: true, atEdge: false }]);
  expect(shown.labels.map(({ key, text, level }) => [key, text, level])).toEqual([['margin', '30 mm', 'ok']]);
  expect(shown.count).toBeGreaterThan(500);
});

it('its level is by limits what they say, else a caution near the edge and a fault outside', () => {
  expect(drawn(leg({ aside: 0.035 }), pose(392))).toMatchObject({ level: 'caution' });
  expect(drawn(leg({ aside: 0.062 }), pose(392))).toMatchObject({ level: 'fault' });
  const [{ text } = { text: '' }] = drawn(leg({ aside: 0.062 }), pose(392)).labels;
  expect(text).toBe('−12 mm');
  const limits = { low: 10, high: null, caution: 0.4 };
  const at = (aside: number) => drawn(leg({ aside }), pose(392), { limits }).level;
  expect([at(0.02), at(0.03), at(0.045)]).toEqual(['ok', 'caution', 'fault']);
});

it.each([
  ['the page’s limits', null, ['ok', 'caution', 'caution', 'ok', 'fault', 'caution']],
  [
    'the profile’s limits',
    { low: 8, high: null, caution: 0.4 },
    ['ok', 'caution', 'caution', 'ok', 'fault', 'fault'],
  ],
] as const)('is judged as the words are, by %s', (_, limits, levels) => {
  const body = leg();
  const thigh = { elements: Array.from(body.linkMatrix('thigh')!.elements) };
  const linkMatrix = body.linkMatrix.bind(body);
  Object.assign(body, { linkMatrix: (name: string) => (name === 'thigh' ? thigh : linkMatrix(name)) });
  const signs = new BalanceDrawing();
  const [reader, judge] = [new BalanceReader(body.manifest, SCHEMA), new StanceJudge()];
  const words = limits === null ? marginLimits(null) : limitsBy(limits, 'profile');
  // to the amber edge, a little back, well back; outside, and then back in so fast that it comes to rest inside
  const course = [0.02, 0.031, 0.029, 0.026, 0.075, 0.065];
  const found = course.map((aside, i) => {
    thigh.elements[13] = aside;
    const now = pose(392, i < 4 ? i / 30 : 2 + i / 30);
    draw(signs, body, now, { limits });
    const balance = reader.ofBody(body, reader.wrenchesOf(now.wrenches!), now.tS!);
    const { level = null, kind = null } = judge.next(balance, 0, words) ?? {};
    expect(signs.shown?.level).toBe(level);
    return [level, kind];
  });
  expect(found.map(([level]) => level)).toEqual(levels);
  expect(found.at(-1)?.[1]).toBe('moving');
});

it('what is not known is not drawn', () => {
  expect(drawn(leg(), null).count).toBe(0);
  const none = { count: 0, centreOfMass: null, polygon: [], marginM: null, labels: [] };
  expect(drawn(leg(), { ...pose(392), unturned: true })).toMatchObject(none);
  expect(drawn(leg(), { ...pose(392), unread: new Set(['knee']) })).toMatchObject(none);
  expect(drawn(leg(), { ...pose(392), unread: new Set(['a finger']) }).marginM).not.toBeNull();
  expect(drawn(leg(), pose(392), { choice: 'auto' }).count, 'one foot is no biped').toBe(0);

  const massless = drawn(leg({ masses: false }), pose(392));
  expect(massless).toMatchObject({ centreOfMass: null, marginM: null, labels: [] });
  expect(massless.polygon?.length).toBe(4);

  const airborne = drawn(leg(), pose(0));
  expect(airborne).toMatchObject({ polygon: [], floorM: null, marginM: null, pressure: null, labels: [] });
  expect(airborne.centreOfMass).not.toBeNull();

  const unread = drawn(leg(), pose(null));
  expect(unread).toMatchObject({ polygon: [], pressure: null, feet: [{ bears: null, pressure: null }] });
  expect(drawn(leg(), { joints: NO_JOINTS, base: null }).polygon, 'a pose without wrenches').toEqual([]);
});

it('marks a foot that begins to tip', () => {
  const tipping = drawn(leg(), pose(392, 1, -0.148 * 392));
  expect(tipping.feet).toMatchObject([{ atEdge: true }]);
  expect(tipping.count).toBeGreaterThan(drawn(leg(), pose(392)).count);
});

it('the selected joint has its way between its limits, and what is left of it in words', () => {
  const body = leg();
  (body.manifest.joints[1] as { limits: unknown }).limits = { lower: -0.1, upper: 2 };
  const shown = drawn(body, pose(392), { joints: ['knee', 'elbow'] });
  expect(shown.joints).toEqual([{ joint: 'knee', left: 0.1, slides: false }]);
  expect(shown.labels.map(({ key }) => key)).toEqual(['margin', 'left-knee']);
  expect(shown.labels[1]!.text).toBe('0.10 rad');
  const degrees = drawn(body, pose(392), { joints: ['knee'] }, { settings: { angle: 'deg' } });
  expect(degrees.labels[1]!.text).toBe('5.7 °');
});

it('another model or schema begins anew', () => {
  const signs = new BalanceDrawing();
  const step = (body: PosedBody, tS: number, fz: number) => {
    draw(signs, body, pose(fz, tS));
    return signs.shown?.footprints;
  };
  const body = leg();
  step(body, 1, 392);
  expect(step(body, 1.1, 0)).toBe(1);
  expect(step(leg(), 1.2, 0)).toBe(0);
});

it('tells what a picture costs', () => {
  const [signs, picture] = [new BalanceDrawing(), signPicture(undefined, { body: leg() })];
  const facets = picture.facets!;
  const begunMs = performance.now();
  const pictures = 500;
  for (let i = 0; i < pictures; i += 1) {
    facets.begin();
    signs.draw({ ...picture, pose: pose(392, i / 60) }, facets, READINGS);
    facets.end();
  }
  const ms = (performance.now() - begunMs) / pictures;
  console.log(`balance of one robot, arithmetic and ${facets.count} facets: ${ms.toFixed(3)} ms a picture`);
});
