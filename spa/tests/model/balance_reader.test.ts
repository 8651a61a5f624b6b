import { parseSchema } from '@posecast/wire';
import { expect, it } from 'vitest';
import { BalanceReader, FrameBody } from '../../src/model/balance/balance_reader.ts';
import { readManifest } from '../../src/model/manifest.ts';
import { ForcePlay } from '../../src/twin/playback/player.ts';
import { type BalanceFrame, readBalanceCases, tellBalance } from '../rigs/balance_vectors.ts';

/** Rounding of the codes in the vectors: 0.1 mN and 0.1 mN·m move a centre of pressure by less. */
const NEAR = 5e-6;

/** Compares numbers within the vectors' rounding, everything else exactly. */
function near(value: unknown, by = NEAR): unknown {
  if (typeof value === 'number')
    return expect.toSatisfy((found) => Math.abs((found as number) - value) <= by);
  if (Array.isArray(value)) return value.map((each) => near(each, by));
  if (typeof value !== 'object' || value === null) return value;
  return Object.fromEntries(
    Object.entries(value).map(([key, each]) => [key, near(each, key === 'force_n' ? 2e-3 : by)]),
  );
}

const cases = readBalanceCases();

it.each(cases)('$name: the balance is what the vectors say', ({ manifest, schema, frames }) => {
  const reader = new BalanceReader(manifest, schema);
  for (const [i, { t, codes, balance }] of frames.entries()) {
    const found = tellBalance(reader.ofFrame(Int32Array.from(codes), t));
    expect(found, `frame ${i}`).toEqual(near(balance));
  }
});

it.each(cases)(
  '$name: a body that is shown has the same balance as its frame',
  ({ manifest, schema, frames }) => {
    const [byBody, byFrame] = [new BalanceReader(manifest, schema), new BalanceReader(manifest, schema)];
    const body = new FrameBody(manifest, schema);
    const linkMatrix = (name: string) => {
      const at = manifest.links.indexOf(name) * 16;
      return { elements: body.worldFromLink.subarray(at, at + 16) };
    };
    for (const { t, codes } of frames) {
      const read = Int32Array.from(codes);
      const pose = body.follow(read);
      const found = byBody.ofBody({ linkMatrix }, byBody.wrenches(read), t, pose);
      expect(tellBalance(found)).toEqual(tellBalance(byFrame.ofFrame(read, t)));
    }
  },
);

it.each(cases)('$name: what is played with the pose is in N and N·m, too', ({ manifest, schema, frames }) => {
  const [reader, ofFrame] = [new BalanceReader(manifest, schema), new BalanceReader(manifest, schema)];
  const play = new ForcePlay(schema);
  const numbers = new Float64Array(play.size);
  for (const { codes } of frames) {
    play.read(Int32Array.from(codes), numbers);
    const read = structuredClone(ofFrame.wrenches(Int32Array.from(codes)));
    expect(reader.wrenchesOf(play.of(numbers))).toEqual(near(read, 1e-9));
  }
});

const stands = cases.find(({ name }) => name === 'stands')!;

/** The balance of the first standing frame, with changes to the manifest or the schema. */
function readOtherwise(members: Record<string, unknown>, mapping?: unknown) {
  const manifest = readManifest({ ...stands.manifest.raw, ...members });
  const text = JSON.stringify({
    ...(JSON.parse(stands.schema.text) as object),
    ...(mapping ? { mapping } : {}),
  });
  const reader = new BalanceReader(manifest, parseSchema(text));
  const [{ t, codes }] = stands.frames as [BalanceFrame];
  return { reader, told: tellBalance(reader.ofFrame(Int32Array.from(codes), t)) };
}

it('what a bundle has wrong is told in a line, and is as good as not there', () => {
  const { reader, told } = readOtherwise({ inertials: [{ link: 99 }], soles: 'none' });
  expect(reader.problems).toEqual([
    'model manifest: inertials[0]: its link does not exist',
    'model manifest: soles is not a list',
  ]);
  expect([told.gaps.centre_of_mass, told.gaps.polygon]).toEqual(['old-bundle', 'old-bundle']);
  expect([reader.hasAny, reader.onByItself]).toEqual([false, false]);
});

it('what a profile has wrong is told in a line, and the model is taken instead', () => {
  const { sensors } = JSON.parse(stands.schema.text).mapping;
  const { reader, told } = readOtherwise({}, { sensors, balance: { feet: 3 } });
  expect(reader.problems.length).toBe(1);
  expect(reader.problems[0]).toMatch(/^.*mapping\.balance\.feet.*$/);
  expect([told.ground, Object.keys(told.feet)]).toEqual(['measured', ['RF', 'LF']]);
});

it('feet of the profile that the model lacks, or whose sole spans no area, are left out', () => {
  const { sensors } = JSON.parse(stands.schema.text).mapping;
  const line = [0, 1, 2].map((x) => [x, 0, 0]);
  const rule = { feet: ['no such link', 'head', 'RF', 'LF'], soles: { LF: line } };
  const { reader, told } = readOtherwise({}, { sensors, balance: { ...rule, ground: 'lowest' } });
  expect(Object.keys(told.feet)).toEqual(['RF']);
  expect(reader.problems).toEqual(
    ['no such link', 'head', 'LF'].map((name) => expect.stringContaining(name)),
  );
});

it('with one of these missing and the ground measured there is no polygon, and no margin', () => {
  const { sensors } = JSON.parse(stands.schema.text).mapping;
  const { told } = readOtherwise({}, { sensors, balance: { feet: ['RF', 'LF', 'XF'] } });
  expect([told.feet, told.gaps.polygon, told.margin_m]).toEqual([{}, 'no-feet', null]);
});

it('a foot under two names, its sensor and its link, counts once', () => {
  const { sensors } = JSON.parse(stands.schema.text).mapping;
  const feet = ['RF', 'LF', 'lfoot'];
  const measured = readOtherwise({}, { sensors, balance: { feet } });
  expect([measured.told.feet, measured.told.gaps.polygon]).toEqual([{}, 'no-feet']);
  expect(measured.reader.problems).toEqual(['[balance] LF and lfoot are one foot']);
  const { told } = readOtherwise({}, { sensors, balance: { feet, ground: 'lowest' } });
  expect(Object.keys(told.feet)).toEqual(['RF', 'LF']);
});

it('a robot is on by itself with masses and two feet that measure force', () => {
  const on = cases.map(
    ({ name, manifest, schema }) => [name, new BalanceReader(manifest, schema).onByItself] as const,
  );
  expect(on.filter(([, is]) => !is).map(([name]) => name)).toEqual([
    'has no wrenches',
    'its profile has feet and soles',
    'its profile says it stands on nothing',
    'one foot alone has a wrench',
    'lies on its back',
    'stands on its head, without wrenches',
    'kneels',
    'a sole that is none',
    'its profile names a foot that is not there',
    "has masses beyond any robot's",
    'has no soles',
    'has no masses',
    "has masses that can't be",
    'an older bundle',
  ]);
});

it('of a body that lacks a link nothing is told that depends on it', () => {
  const { manifest, schema, frames } = stands;
  const reader = new BalanceReader(manifest, schema);
  const body = new FrameBody(manifest, schema);
  body.follow(Int32Array.from(frames[0]!.codes));
  const linkMatrix = (name: string) => {
    const at = manifest.links.indexOf(name) * 16;
    return name === 'rsole' ? undefined : { elements: body.worldFromLink.subarray(at, at + 16) };
  };
  const told = tellBalance(
    reader.ofBody({ linkMatrix }, reader.wrenches(Int32Array.from(frames[0]!.codes)), 0),
  );
  expect(told.centre_of_mass_m).not.toBeNull();
  expect(told.gaps.polygon).toBe('unread');
  expect([told.floor_m, told.margin_m, told.centre_of_pressure_m, told.capture_point_m]).toEqual([
    null,
    null,
    null,
    null,
  ]);
});

it('a floor at zero has no minus', () => {
  const { manifest, schema, frames } = stands;
  const upright = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -0, 1];
  const under = [
    [-0.1, -0.05, -0],
    [0.1, -0.05, -0],
    [0, 0.05, -0],
  ];
  const soles = (manifest.raw.soles as { link: number }[]).map(({ link }) => ({ link, points: under }));
  const reader = new BalanceReader(readManifest({ ...manifest.raw, soles }), schema);
  const wrenches = reader.wrenches(Int32Array.from(frames[0]!.codes));
  const { feet, floorM } = reader.ofBody({ linkMatrix: () => ({ elements: upright }) }, wrenches, 0);
  expect(feet[0]!.corners.some(([, , z]) => Object.is(z, -0))).toBe(true);
  expect(floorM).toBe(0);
});

it('the result is rewritten, but what was told of a pose stays as it was', () => {
  const { manifest, schema, frames } = stands;
  const reader = new BalanceReader(manifest, schema);
  const [{ t, codes }, next] = frames as [BalanceFrame, BalanceFrame];
  const found = reader.ofFrame(Int32Array.from(codes), t);
  const { centreOfMass, pressure, polygon } = found;
  const [corner] = found.feet[0]!.corners;
  const told = structuredClone([centreOfMass, pressure, polygon, corner]);
  expect(reader.ofFrame(Int32Array.from(next.codes), next.t)).toBe(found);
  expect([centreOfMass, pressure, polygon, corner]).toEqual(told);
  expect(found.centreOfMass).not.toEqual(centreOfMass);
});
