/** The cost of untrusted input grows at most in proportion to its length. */

import { parseSchema } from '@posecast/wire';
import { strToU8 } from 'fflate';
import { describe, test, vi } from 'vitest';
import { expectNoFasterThanInput } from '../../../wire/typescript/tests/cost.ts';
import { readParentRequest } from '../../src/app/pages/embed/parent.ts';
import { readRobots } from '../../src/app/pages/list/robots.ts';
import { readShared } from '../../src/app/share/view_address.ts';
import { parseRoute, queryOf } from '../../src/app/state/address.ts';
import { readSettings } from '../../src/app/state/settings.ts';
import { moreEn } from '../../src/app/text/more_en.ts';
import { parseManifest } from '../../src/model/bundle.ts';
import { chooseRelay, readConfig } from '../../src/relay/config.ts';
import { DeviationTable } from '../../src/scene/signs/deviations.ts';
import { readRawManifest } from '../../src/scene/three/raw_bundle.ts';
import { MirrorReader } from '../../src/stream/firebase_mirror.ts';
import { SseParser } from '../../src/stream/sse.ts';
import { JointTable } from '../../src/twin/joints.ts';
import { KinematicTree } from '../../src/twin/kinematic_tree.ts';
import { limbsOf } from '../../src/twin/limbs.ts';
import { ImuTable } from '../../src/twin/sensors/imus.ts';
import { SensorTable } from '../../src/twin/sensors/sensors.ts';
import { WrenchTable } from '../../src/twin/sensors/wrenches.ts';

vi.setConfig({ testTimeout: 120_000 });

type Make<T> = (n: number) => T;

const many = <T>(count: number, of: (i: number) => T): T[] =>
  Array.from({ length: Math.max(1, Math.floor(count)) }, (_, i) => of(i));
const each = (count: number, value: unknown) => Object.fromEntries(many(count, (i) => [`k${i}`, value]));

describe('an address', () => {
  const READ: Record<string, (text: string) => unknown> = {
    route: (text) => parseRoute(`#/r/${text}`),
    view: (text) => readShared(queryOf(`#/r/demo?joint=${text}&eye=${text}`)),
    settings: (text) => readSettings(JSON.stringify(Object.fromEntries(queryOf(`#/?theme=${text}`)))),
    relay: (text) => chooseRelay('https://a.example/', `?relay=https://b.example/${text}`, readConfig({})),
  };
  const WORST: Record<string, Make<string>> = {
    letters: (n) => 'a'.repeat(n),
    pluses: (n) => 'a+'.repeat(n >> 1),
    slashes: (n) => `${'/'.repeat(n)}a`,
    commas: (n) => '1,'.repeat(n >> 1),
    questions: (n) => '?&='.repeat(n / 3),
    escapes: (n) => '%41'.repeat(n / 3),
  };
  test.each(Object.keys(READ).flatMap((what) => Object.keys(WORST).map((of) => [what, of] as const)))(
    '%s of %s',
    (what, of) => expectNoFasterThanInput(WORST[of]!, READ[what]!, 20_000),
  );
});

describe('JSON', () => {
  const READ: Record<string, (document: unknown) => unknown> = {
    'the list of robots': readRobots,
    configuration: readConfig,
    'a wish from around a frame': readParentRequest,
    'a raw manifest': (document) => readRawManifest(parseManifest(JSON.stringify(document))),
  };
  const WORST: Record<string, Make<unknown>> = {
    'many robots': (n) => ({ robots: many(n >> 5, () => ({ robot: 'r', name: '\u202e'.repeat(9) })) }),
    'a long name': (n) => ({ robots: [{ robot: 'r', name: '\u200b'.repeat(n) }] }),
    'many relays': (n) => ({ relays: many(n >> 3, (i) => `${i}`) }),
    'many members': (n) => ({ posecast: 'set', ...each(n >> 4, 'x') }),
    'many files': (n) => ({
      v: 1,
      urdf: 'f0',
      files: many(n >> 6, (i) => ({ path: `f${i}`, uri: `f${i}`, size: 1 })),
    }),
    'a deep path': (n) => ({ v: 1, urdf: 'a', files: [{ path: 'a/'.repeat(n >> 1), uri: 'a', size: 1 }] }),
  };
  test.each(Object.keys(READ).flatMap((what) => Object.keys(WORST).map((of) => [what, of] as const)))(
    '%s of %s',
    (what, of) => expectNoFasterThanInput(WORST[of]!, READ[what]!, 40_000),
  );
});

describe('a stream', () => {
  const inPieces = (bytes: Uint8Array, size: number) => {
    const reader = new SseParser();
    for (let at = 0; at < bytes.length; at += size) reader.read(bytes.subarray(at, at + size));
  };
  test.each<[string, Make<string>]>([
    ['one long line', (n) => `data: ${'a'.repeat(n)}\n\n`],
    ['many lines', (n) => 'data:\n'.repeat(n / 6)],
    ['many events', (n) => 'data: a\n\n'.repeat(n / 9)],
    ['no field', (n) => ':'.repeat(n)],
    ['carriage returns', (n) => '\r'.repeat(n)],
  ])('of %s, in small pieces', (_, make) =>
    expectNoFasterThanInput(
      (n) => strToU8(make(n)),
      (bytes) => inPieces(bytes, 16),
      30_000,
    ),
  );

  test.each<[string, Make<unknown>]>([
    ['members', (n) => each(n >> 4, 1)],
    ['members of status', (n) => Object.fromEntries(many(n >> 4, (i) => [`status/k${i}`, i]))],
    ['a deep path', (n) => ({ ['a/'.repeat(n >> 1)]: 1 })],
  ])('of a mirror: a patch of %s', (_, make) => {
    const read = (data: string) => {
      const reader = new MirrorReader(1);
      reader.read(0, { name: 'put', data: '{"path":"/","data":{"status":{"at":1,"robot":"online"}}}' });
      reader.read(0, { name: 'patch', data });
    };
    expectNoFasterThanInput((n) => JSON.stringify({ path: '/', data: make(n) }), read, 40_000);
  });
});

describe('what the page makes of a schema', () => {
  const text = (members: object) => JSON.stringify({ type: 'schema', v: 1, robot: 'r', ...members });
  const field = (name: string, labels: string) => ({ name, labels });
  const sites = (n: number, parts: readonly string[]) =>
    many(n / parts.length, (i) => parts.map((part) => `${i}.${part}`)).flat();
  const read = (source: string) => {
    const schema = parseSchema(source);
    new JointTable(schema);
    new SensorTable(schema);
    new ImuTable(schema);
    new WrenchTable(schema);
    new DeviationTable(schema);
    limbsOf(schema, null, moreEn);
  };
  test.each<[string, Make<object>]>([
    [
      'joints',
      (n) => ({
        labels: { joint: many(n, (i) => `${i}`) },
        fields: [field('ref', 'joint'), field('pos', 'joint')],
        mapping: { tolerance: { '*': 1 } },
      }),
    ],
    ['attitudes', (n) => ({ labels: { s: sites(n, ['w', 'x', 'y', 'z']) }, fields: [field('quat', 's')] })],
    [
      'forces',
      (n) => ({
        labels: { s: sites(n, ['fx', 'fy', 'fz']) },
        fields: [field('ftf', 's')],
        mapping: { sensors: Object.fromEntries(many(n / 3, (i) => [`${i}`, { kind: 'wrench', link: 'l' }])) },
      }),
    ],
    [
      'terms',
      (n) => ({
        labels: { joint: ['a', 'b'] },
        fields: [field('ref', 'joint'), field('pos', 'joint')],
        mapping: {
          joints: Object.fromEntries(many(n, (i) => [`j${i}`, { terms: [['a', 1]] }])),
          tolerance: { '*': 1 },
        },
      }),
    ],
  ])('of many %s', (_, make) => expectNoFasterThanInput((n) => text(make(n)), read, 120));

  test('limb by limb, along a chain', () => {
    const made = (n: number) => {
      const labels = many(n, (i) => `j${i}`);
      const schema = parseSchema(text({ labels: { joint: labels }, fields: [field('pos', 'joint')] }));
      const link = (i: number) => ({
        link: `l${i}`,
        parent: i === 0 ? null : `l${i - 1}`,
        joint: labels[i]!,
      });
      return { schema, tree: new KinematicTree(many(n, link)) };
    };
    expectNoFasterThanInput(made, ({ schema, tree }) => limbsOf(schema, tree, moreEn), 60);
  });
});
