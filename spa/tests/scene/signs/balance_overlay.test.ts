import { parseSchema } from '@posecast/wire';
import { expect, it } from 'vitest';
import { BalanceReader } from '../../../src/model/balance/balance_reader.ts';
import type { PosedBody } from '../../../src/model/posed_body.ts';
import { BalanceOverlay } from '../../../src/scene/signs/balance/balance_overlay.ts';
import { Facets } from '../../../src/scene/signs/balance/shapes.ts';
import type { BalanceStyle } from '../../../src/scene/signs/balance_drawing.ts';
import { OVERLAY_COLORS } from '../../../src/scene/signs/colors.ts';
import { limitsBy, marginLimits } from '../../../src/twin/balance/margin_limits.ts';
import { StanceJudge } from '../../../src/twin/balance/stance.ts';
import type { BalanceReadings } from '../../../src/twin/overlay/reader.ts';
import type { Pose } from '../../../src/twin/playback/pose.ts';
import { NO_JOINTS } from '../../../src/twin/playback/pose.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';
import { sampleLeg } from '../../rigs/leg_sample.ts';

const COMPONENTS = ['fx', 'fy', 'fz'].map((one) => `F.${one}`);
const MOMENTS = ['mx', 'my', 'mz'].map((one) => `F.${one}`);

const SCHEMA = parseSchema(
  JSON.stringify({
    ...{ type: 'schema', v: 1, robot: 'Leg' },
    labels: { joint: ['knee'], ftf: COMPONENTS, ftm: MOMENTS },
    fields: [
      { name: 'pos', unit: 'rad', scale: 0.001, labels: 'joint' },
      { name: 'ftf', unit: 'N', scale: 1, labels: 'ftf' },
      { name: 'ftm', unit: 'Nm', scale: 0.01, labels: 'ftm' },
    ],
    mapping: {
      sensors: { F: { kind: 'wrench', name: 'foot', link: 'foot' } },
      balance: { feet: ['F'], ground: 'measured' },
    },
  }),
);

const STYLE: BalanceStyle = {
  reach: 0.5,
  tones: OVERLAY_COLORS.dark,
  palette: 'standard',
  angle: 'rad',
  live: true,
};
const READINGS: BalanceReadings = { schema: SCHEMA, choice: 'on', limits: null, joints: [], anchored: true };

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

function drawn(
  body: PosedBody | null,
  shownPose: Pose | null,
  readings: Partial<BalanceReadings> = {},
  style: Partial<BalanceStyle> = {},
) {
  const facets = new Facets();
  const signs = new BalanceOverlay(facets);
  facets.begin();
  signs.draw(body, shownPose, { ...READINGS, ...readings }, { ...STYLE, ...style });
  facets.end();
  return { ...signs.shown, count: facets.count, labels: signs.labels() };
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
  const facets = new Facets();
  const signs = new BalanceOverlay(facets);
  const [reader, judge] = [new BalanceReader(body.manifest, SCHEMA), new StanceJudge()];
  const words = limits === null ? marginLimits(null) : limitsBy(limits, 'profile');
  // to the amber edge, a little back, well back; outside, and then back in so fast that it comes to rest inside
  const course = [0.02, 0.031, 0.029, 0.026, 0.075, 0.065];
  const found = course.map((aside, i) => {
    thigh.elements[13] = aside;
    const now = pose(392, i < 4 ? i / 30 : 2 + i / 30);
    facets.begin();
    signs.draw(body, now, { ...READINGS, limits }, STYLE);
    const balance = reader.ofBody(body, reader.wrenchesOf(now.wrenches!), now.tS!);
    const { level = null, kind = null } = judge.next(balance, 0, words) ?? {};
    expect(signs.shown?.level).toBe(level);
    return [level, kind];
  });
  expect(found.map(([level]) => level)).toEqual(levels);
  expect(found.at(-1)?.[1]).toBe('moving');
});

it('what is not known is not drawn', () => {
  expect(drawn(null, pose(392)).count).toBe(0);
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
  const degrees = drawn(body, pose(392), { joints: ['knee'] }, { angle: 'deg' });
  expect(degrees.labels[1]!.text).toBe('5.7 °');
});

it('is grey, words too, when the pose is old', () => {
  const { labels } = drawn(leg(), pose(392), {}, { live: false });
  expect(labels.map(({ old }) => old)).toEqual([true]);
});

it('another model or schema begins anew', () => {
  const facets = new Facets();
  const signs = new BalanceOverlay(facets);
  const step = (body: PosedBody, tS: number, fz: number) => {
    facets.begin();
    signs.draw(body, pose(fz, tS), READINGS, STYLE);
    return signs.shown?.footprints;
  };
  const body = leg();
  step(body, 1, 392);
  expect(step(body, 1.1, 0)).toBe(1);
  expect(step(leg(), 1.2, 0)).toBe(0);
});

it('tells what a picture costs', () => {
  const [facets, body] = [new Facets(), leg()];
  const signs = new BalanceOverlay(facets);
  const begunMs = performance.now();
  const pictures = 500;
  for (let i = 0; i < pictures; i += 1) {
    facets.begin();
    signs.draw(body, pose(392, i / 60), READINGS, STYLE);
    facets.end();
  }
  const ms = (performance.now() - begunMs) / pictures;
  console.log(`balance of one robot, arithmetic and ${facets.count} facets: ${ms.toFixed(3)} ms a picture`);
});
