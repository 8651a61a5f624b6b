/** The cost of a robot's model and of a dropped folder grows at most in proportion to their length, whatever they contain. */

import { strToU8, zipSync } from 'fflate';
import { afterAll, beforeAll, describe, expect, test, vi } from 'vitest';
import {
  expectNoFasterThanInput,
  expectTurnsNoFasterThanInput,
} from '../../../wire/typescript/tests/cost.ts';
import { parseManifest } from '../../src/model/bundle.ts';
import { Kinematics } from '../../src/model/kinematics.ts';
import { readLod } from '../../src/model/lod.ts';
import { boxesOfLinks, readManifest } from '../../src/model/manifest.ts';
import { diagnose } from '../../src/urdf/doctor.ts';
import type { openLocal } from '../../src/urdf/local_robot.ts';
import { modelOf, UrdfError } from '../../src/urdf/manifest.ts';
import { parseStl } from '../../src/urdf/meshes/stl.ts';
import { weld } from '../../src/urdf/meshes/weld.ts';
import { readUrdf } from '../../src/urdf/reader.ts';
import type { Urdf } from '../../src/urdf/types.ts';
import { unzip } from '../../src/urdf/unzip.ts';
import { readXml, type XmlElement } from '../../src/urdf/xml.ts';

vi.setConfig({ testTimeout: 120_000 });

type Make<T> = (n: number) => T;

const many = <T>(count: number, of: (i: number) => T): T[] =>
  Array.from({ length: Math.max(1, Math.floor(count)) }, (_, i) => of(i));

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
    expect(() => readManifest(twice)).toThrow('model manifest: links: a name is used twice');
    const joints = [joint(0, 0), { ...joint(1, 1), name: 'j0' }];
    expect(() => readManifest({ ...robot(2, (i) => i), joints })).toThrow('joints: a name is used twice');
  });
});

/** A GLB with this document, followed by this many bytes. */
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
      (b) => readLod(b, 1),
      500,
    ));
  test('of many pictures', () =>
    expectTurnsNoFasterThanInput(
      (n) => level(n, 1, n),
      (b) => readLod(b, 1),
      15,
    ));
  test('of many nodes that show one mesh is refused before it fills the memory', async () => {
    await expect(readLod(level(5000, 1000, 1), 1000)).rejects.toThrow('unpacks to too many bytes');
  });
});

describe('XML', () => {
  // A browser's own parser is not measured: it is told to reject everything.
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

/** As returned by `readXml`. */
function element(
  tag: string,
  attributes: Record<string, string> = {},
  children: XmlElement[] = [],
): XmlElement {
  return {
    ...{ tag, children, line: 1, attributes: Object.keys(attributes) },
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
  ])('%s', (_, make, n) => expectNoFasterThanInput(make, (root) => drawn(readUrdf(root)), n));
});

/** Everything computed from a URDF before its meshes are read. */
function drawn(urdf: Urdf): void {
  diagnose(urdf, new Map(), null);
  try {
    modelOf(urdf);
  } catch (cause) {
    if (!(cause instanceof UrdfError)) throw cause; // a cycle has no root
  }
}

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
    vi.doMock('../../src/urdf/xml.ts', async (original) => ({ ...(await original()), readXml: () => root }));
    vi.resetModules();
    const { openLocal: open } = (await import('../../src/urdf/local_robot.ts')) as {
      openLocal: typeof openLocal;
    };
    const files = folder([...many(200, (i) => `f${i}/a`), 'r.urdf'], '<robot/>');
    const read = (made: XmlElement) => {
      root = made;
      return open(files, 'r.urdf');
    };
    await expect(read(shown(100))).resolves.toBeDefined();
    await expectTurnsNoFasterThanInput(shown, read, 4000);
    vi.doUnmock('../../src/urdf/xml.ts');
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

  /** A fan: each face has a different tilt, around one corner. */
  const fan = (n: number) =>
    Float32Array.from(
      many(n, (i) => {
        const [a, b] = [i, i + 0.5].map((turn) => (2 * Math.PI * turn) / n);
        return [0, 0, 0, Math.cos(a!), Math.sin(a!), i % 7, Math.cos(b!), Math.sin(b!), (i * 31) % 11];
      }).flat(),
    );
  test('of faces round one corner', () => expectNoFasterThanInput(fan, weld, 2000));
  /** Corners whose bits collide in a hash with the usual factors. */
  const colliding = (n: number) => {
    const bits = new Uint32Array(n * 9);
    for (let i = 0; i < n * 3; i += 1) bits.set([0x3f800000 + (i << 7), 0x3f800000, 0x3f800000], i * 3);
    return new Float32Array(bits.buffer);
  };
  test('of corners of like bits', () => expectNoFasterThanInput(colliding, weld, 2000));
});
