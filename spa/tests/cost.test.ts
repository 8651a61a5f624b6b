/** What strangers send, and what lies in a dropped folder, costs no more than in proportion to its length. */

import { parseSchema } from '@posecast/wire';
import { strToU8, zipSync } from 'fflate';
import { afterAll, beforeAll, describe, expect, test, vi } from 'vitest';
import { expectNoFasterThanInput, expectTurnsNoFasterThanInput } from '../../wire/typescript/tests/cost.ts';
import { readWish } from '../src/app/embed_messages.ts';
import { chooseRelay, readConfig } from '../src/app/relay_config.ts';
import { readRobots } from '../src/app/robots.ts';
import { parseRoute } from '../src/app/route.ts';
import { queryOf, readSettings } from '../src/app/settings.ts';
import { readShared } from '../src/app/shared_view.ts';
import { moreEn } from '../src/app/text/more_en.ts';
import { diagnose } from '../src/drop/doctor.ts';
import type { openLocal } from '../src/drop/local_robot.ts';
import { unzip } from '../src/drop/unzip.ts';
import { readUrdf } from '../src/drop/urdf_reader.ts';
import { readXml, type XmlElement } from '../src/drop/xml.ts';
import { parseManifest, readRawManifest } from '../src/scene/bundle.ts';
import { Kinematics } from '../src/scene/kinematics.ts';
import { readLevel } from '../src/scene/level.ts';
import { boxesOfLinks, readManifest } from '../src/scene/manifest.ts';
import { parseStl } from '../src/scene/stl.ts';
import { weld } from '../src/scene/weld.ts';
import { EventReader } from '../src/stream/events.ts';
import { MirrorReader } from '../src/stream/mirror.ts';
import { ImuTable } from '../src/twin/imus.ts';
import { JointTable } from '../src/twin/joints.ts';
import { KinematicTree } from '../src/twin/kinematic_tree.ts';
import { Lens } from '../src/twin/lens.ts';
import { limbsOf } from '../src/twin/limbs.ts';
import { SensorTable } from '../src/twin/sensors.ts';
import { WrenchTable } from '../src/twin/wrenches.ts';

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
    'a wish from around a frame': readWish,
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

describe('a manifest', () => {
  const joint = (i: number, parent: number, more: object = {}) => ({
    ...{ name: `j${i}`, type: 'revolute', parent, child: i + 1, ...more },
  });
  const robot = (n: number, parent: (i: number) => number, more = (_i: number): object => ({})) => ({
    ...{ v: 2, links: many(n + 1, (i) => `l${i}`), levels: [] },
    joints: many(n, (i) => joint(i, parent(i), more(i))),
    visuals: many(n, (i) => ({
      link: i,
      source: 's',
      box: [
        [0, 0, 0],
        [1, 1, 1],
      ],
    })),
  });
  test.each([
    ['a chain', (n: number) => robot(n, (i) => i)],
    ['a star', (n: number) => robot(n, () => 0)],
    [
      'a chain of mimics',
      (n: number) =>
        robot(
          n,
          (i) => i,
          (i) => ({ mimic: { joint: Math.max(0, i - 1) } }),
        ),
    ],
  ])('%s', (_, make) => {
    const read = (text: string) => {
      const found = readManifest(parseManifest(text));
      new Kinematics(found.joints).compute();
      boxesOfLinks(found);
    };
    expectNoFasterThanInput((n) => JSON.stringify(make(n)), read, 60);
  });

  test('names that stand there twice are refused: they would go round in a circle', () => {
    const twice = { ...robot(2, (i) => i), links: ['a', 'b', 'a'] };
    expect(() => readManifest(twice)).toThrow('model manifest: links: a name stands there twice');
    const joints = [joint(0, 0), { ...joint(1, 1), name: 'j0' }];
    expect(() => readManifest({ ...robot(2, (i) => i), joints })).toThrow(
      'joints: a name stands there twice',
    );
  });
});

/** A GLB of this document, and as many bytes behind it. */
function glb(document: object, binary: number): Uint8Array {
  const json = strToU8(JSON.stringify(document));
  const length = json.length + ((4 - (json.length % 4)) % 4);
  const bytes = new Uint8Array(28 + length + binary);
  const view = new DataView(bytes.buffer);
  [0x46546c67, 2, bytes.length, length, 0x4e4f534a].forEach((word, i) => {
    view.setUint32(4 * i, word, true);
  });
  bytes.fill(0x20, 20, 20 + length).set(json, 20);
  view.setUint32(20 + length, binary, true);
  view.setUint32(24 + length, 0x004e4942, true);
  return bytes;
}

describe('a GLB', () => {
  const view = (byteLength: number) => ({ buffer: 0, byteOffset: 0, byteLength });
  const level = (n: number, nodes: number, pictures = 0) => {
    const vertices = 64;
    const attributes = { POSITION: 0, NORMAL: 1 };
    return glb(
      {
        nodes: many(nodes, () => ({ mesh: 0 })),
        meshes: [
          {
            primitives: many(n, (i) => ({
              ...{ attributes, indices: 2 + i, material: i, extras: { first: 0, count: vertices } },
            })),
          },
        ],
        accessors: [
          { bufferView: 0, count: vertices, componentType: 5122, type: 'VEC3' },
          { bufferView: 0, count: vertices, componentType: 5120, type: 'VEC3' },
          ...many(n, () => ({ bufferView: 0, count: 3, componentType: 5125, type: 'SCALAR' })),
        ],
        materials: many(n, (i) => ({ pbrMetallicRoughness: { baseColorTexture: { index: i } } })),
        textures: many(n, (i) => ({ source: i })),
        images: many(pictures, () => ({ bufferView: 0, mimeType: 'image/png' })),
        bufferViews: [view(vertices * 8)],
      },
      vertices * 8,
    );
  };
  test('of many primitives', () =>
    expectTurnsNoFasterThanInput(
      (n) => level(n, 1, 1),
      (b) => readLevel(b, 1),
      500,
    ));
  test('of many pictures', () =>
    expectTurnsNoFasterThanInput(
      (n) => level(n, 1, n),
      (b) => readLevel(b, 1),
      15,
    ));
  test('of many nodes that show one mesh is refused before it fills the memory', async () => {
    await expect(readLevel(level(5000, 1000, 1), 1000)).rejects.toThrow('unpacks to too many bytes');
  });
});

describe('XML', () => {
  // A browser's own reader is not ours to measure: it is told to find fault with everything.
  beforeAll(() =>
    vi.stubGlobal(
      'DOMParser',
      class {
        parseFromString = () => ({ querySelector: () => ({ textContent: 'refused' }) });
      },
    ),
  );
  afterAll(() => vi.unstubAllGlobals());

  test.each<[string, Make<string>]>([
    ['a name without end', (n) => `<robot><${'a'.repeat(n)}`],
    ['names without end', (n) => `<robot>${`<${'a'.repeat(500)}`.repeat(n / 500)}`],
    ['an attribute without end', (n) => `<robot a="${'a '.repeat(n >> 1)}`],
    ['quotes', (n) => `<robot ${'"\''.repeat(n >> 1)}`],
    ['quotes and tags', (n) => `<robot ${'<"'.repeat(n >> 1)}`],
    ['many prefixes', (n) => `<robot ${many(n >> 4, (i) => `p${i}:a="1"`).join(' ')}/>`],
    [
      'many prefixes in many tags',
      (n) => `<robot>${many(n >> 3, (i) => `<p${i % 900}:a/>`).join('')}</robot>`,
    ],
    ['blanks', (n) => `<robot${' '.repeat(n)}`],
    ['lines', (n) => `<robot>${'\n'.repeat(n)}</robot>`],
    ['carriage returns', (n) => `<robot>${'\r'.repeat(n)}</robot>`],
    ['comments', (n) => `${'<!---->'.repeat(n / 7)}<robot/>`],
    ['comments that never end', (n) => '<!--'.repeat(n >> 2)],
    ['declarations', (n) => '<?xml'.repeat(n / 5)],
    ['a late declaration', (n) => `${' '.repeat(n)}<?xml ?><robot/>`],
    ['many elements', (n) => `<robot>${'<a b="c"/>'.repeat(n / 10)}</robot>`],
    ['ends', (n) => `<robot>${'</a>'.repeat(n >> 2)}`],
    ['depth', (n) => '<a>'.repeat(n / 3)],
  ])('%s', (_, make) => expectNoFasterThanInput(make, readXml, 20_000));
});

/** As `readXml` gives it. */
function element(
  tag: string,
  attributes: Record<string, string> = {},
  children: XmlElement[] = [],
): XmlElement {
  return {
    ...{ tag, children, line: 1 },
    get: (name: string) => attributes[name] ?? null,
    all: (one: string) => children.filter((child) => child.tag === one),
    first: (one: string) => children.find((child) => child.tag === one) ?? null,
  } as unknown as XmlElement;
}

describe('a URDF', () => {
  const link = (name: string, inside: XmlElement[] = []) => element('link', { name }, inside);
  const joint = (name: string, parent: string, child: string, inside: XmlElement[] = []) =>
    element('joint', { name, type: 'revolute' }, [
      element('parent', { link: parent }),
      element('child', { link: child }),
      ...inside,
    ]);
  const robot = (children: XmlElement[]) => element('robot', { name: 'r' }, children);
  const chain = (n: number, parent: (i: number) => number, inside = (_i: number): XmlElement[] => []) =>
    robot([
      ...many(n + 1, (i) => link(`l${i}`)),
      ...many(n, (i) => joint(`j${i}`, `l${parent(i)}`, `l${i + 1}`, inside(i))),
    ]);
  const visual = (attributes: Record<string, string>) =>
    element('visual', {}, [element('geometry', {}, [element('mesh', attributes)])]);

  test.each<[string, Make<XmlElement>, number]>([
    ['a chain', (n) => chain(n, (i) => i), 60],
    ['a star', (n) => chain(n, () => 0), 60],
    ['a circle', (n) => chain(n, (i) => (i + 2) % n), 60],
    [
      'a chain of mimics',
      (n) =>
        chain(
          n,
          () => 0,
          (i) => [element('mimic', { joint: `j${i + 1}` })],
        ),
      60,
    ],
    ['joints of one name', (n) => robot(many(n, () => joint('j', 'a', 'b'))), 500],
    [
      'joints of one link',
      (n) => robot([link('a'), link('b'), ...many(n, (i) => joint(`j${i}`, 'a', 'b'))]),
      500,
    ],
    [
      'meshes of one file',
      (n) =>
        robot([
          link(
            'a',
            many(n, () => visual({ filename: 'm.stl' })),
          ),
        ]),
      120,
    ],
    [
      'materials of one name',
      (n) =>
        robot(many(n, (i) => element('material', { name: 'm' }, [element('color', { rgba: `0 0 0 ${i}` })]))),
      500,
    ],
    [
      'a long number',
      (n) => robot([link('a', [visual({ filename: 'm', scale: `${'1'.repeat(n)}x` })])]),
      20_000,
    ],
    [
      'long numbers',
      (n) =>
        robot([
          link(
            'a',
            many(n / 1000, () => visual({ filename: 'm', scale: `${'1'.repeat(999)}x` })),
          ),
        ]),
      100_000,
    ],
    ['a long name', (n) => robot([link('a'.repeat(n))]), 20_000],
    ['a name of blanks', (n) => robot([link(' '.repeat(n))]), 20_000],
  ])('%s', (_, make, n) =>
    expectNoFasterThanInput(make, (root) => diagnose(readUrdf(root), new Set(), null), n),
  );
});

describe('a dropped folder', () => {
  const folder = (paths: readonly string[], bytes: string) =>
    new Map(paths.map((path) => [path, { size: bytes.length, bytes: async () => strToU8(bytes) }]));

  test('whose URDF names long paths that are not there', async () => {
    const mesh = (n: number) => element('mesh', { filename: 'a/'.repeat(n >> 1) });
    const shown = (n: number) =>
      element('robot', {}, [
        element('link', { name: 'l' }, [element('visual', {}, [element('geometry', {}, [mesh(n)])])]),
      ]);
    let root = shown(1);
    vi.doMock('../src/drop/xml.ts', async (original) => ({ ...(await original()), readXml: () => root }));
    vi.resetModules();
    const { openLocal: open } = (await import('../src/drop/local_robot.ts')) as {
      openLocal: typeof openLocal;
    };
    const files = folder([...many(200, (i) => `f${i}/a`), 'r.urdf'], '');
    const read = (made: XmlElement) => {
      root = made;
      return open(files, 'r.urdf');
    };
    await expect(read(shown(100))).resolves.toBeDefined();
    await expectTurnsNoFasterThanInput(shown, read, 4000);
    vi.doUnmock('../src/drop/xml.ts');
  });

  test.each<[string, Make<Uint8Array>, number]>([
    ['many members', (n) => zipSync(Object.fromEntries(many(n, (i) => [`${i}.stl`, strToU8('x')]))), 200],
    ['a long name', (n) => zipSync({ [`${'a/'.repeat(n >> 1)}.stl`]: strToU8('x') }), 4000],
    [
      'a large member',
      (n) => zipSync({ 'a.stl': many(n, (i) => (i * 7919) % 251) as never }, { level: 1 }),
      20_000,
    ],
    ['no end', (n) => zipSync({ 'a.stl': new Uint8Array(n) }, { level: 0 }).subarray(0, n), 20_000],
    ['heads again and again', (n) => strToU8('PK\x03\x04'.repeat(n >> 2), true), 20_000],
  ])('a zip of %s', (_, make, n) =>
    expectTurnsNoFasterThanInput(
      (size) => (make(size) as Uint8Array<ArrayBuffer>).slice(),
      (bytes) => unzip(new Blob([bytes as Uint8Array<ArrayBuffer>])),
      n,
    ),
  );
});

describe('an STL', () => {
  const facet = (...corners: readonly (readonly number[])[]) =>
    corners.map((at) => `vertex ${at.join(' ')}`).join(' ');
  test.each<[string, Make<string>]>([
    ['facets', (n) => `solid facet ${many(n / 50, (i) => facet([0, 0, i], [1, 0, i], [0, 1, i])).join(' ')}`],
    ['a long word', (n) => `solid facet vertex ${'a'.repeat(n)}`],
    ['blanks', (n) => `solid facet vertex 1 ${' '.repeat(n)}`],
    ['vertices of nothing', (n) => `solid facet ${'vertex '.repeat(n / 7)}`],
  ])('of %s', (_, make) => expectNoFasterThanInput((n) => strToU8(make(n)), parseStl, 20_000));

  /** A fan: each face leans its own way, round one corner. */
  const fan = (n: number) =>
    Float32Array.from(
      many(n, (i) => {
        const [a, b] = [i, i + 0.5].map((turn) => (2 * Math.PI * turn) / n);
        return [0, 0, 0, Math.cos(a!), Math.sin(a!), i % 7, Math.cos(b!), Math.sin(b!), (i * 31) % 11];
      }).flat(),
    );
  test('of faces round one corner', () => expectNoFasterThanInput(fan, weld, 2000));
  /** Corners whose bits fall into one place of a hash by the usual factors. */
  const colliding = (n: number) => {
    const bits = new Uint32Array(n * 9);
    for (let i = 0; i < n * 3; i += 1) bits.set([0x3f800000 + (i << 7), 0x3f800000, 0x3f800000], i * 3);
    return new Float32Array(bits.buffer);
  };
  test('of corners of like bits', () => expectNoFasterThanInput(colliding, weld, 2000));
});

describe('a stream', () => {
  const inPieces = (bytes: Uint8Array, size: number) => {
    const reader = new EventReader();
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
    new Lens(schema);
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
