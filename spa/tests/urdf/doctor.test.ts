// @vitest-environment happy-dom
import { readFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import type { MeshFacts } from '../../src/model/report.ts';
import { quatOfRpy } from '../../src/twin/rotation.ts';
import { diagnose } from '../../src/urdf/doctor.ts';
import { general, quoted } from '../../src/urdf/finding.ts';
import { readUrdf } from '../../src/urdf/reader.ts';
import { readXml, XmlRefused } from '../../src/urdf/xml.ts';

type Row = [severity: string, code: string, text: string, line: number | null];
const CORPUS = JSON.parse(
  readFileSync(path.resolve(import.meta.dirname, '../../../edge-agent/tests/doctor_corpus.json'), 'utf8'),
) as {
  urdf: string;
  meshes?: Record<string, MeshFacts & { hint?: string }>;
  findings: Row[];
  poses?: number[][];
}[];

const found = (
  urdf: string,
  missing: readonly string[] = [],
  meshes: ReadonlyMap<string, MeshFacts & { hint?: string }> | null = null,
): Row[] =>
  diagnose(
    readUrdf(readXml(urdf)),
    new Map(missing.map((uri) => [uri, 'no such file'])),
    meshes,
    new Map([...(meshes ?? [])].flatMap(([uri, { hint }]) => (hint === undefined ? [] : [[uri, hint]]))),
  ).map(({ severity, code, text, line }) => [severity, code, text, line]);

describe("the page's doctor", () => {
  it.each(CORPUS.map((robot, i) => [`${i} ${robot.findings[0]?.[1] ?? 'healthy'}`, robot] as const))(
    'says what `posecast-edge doctor` says: %s',
    (_, { urdf, meshes, findings }) => {
      const missing = Object.keys(meshes ?? {}).filter((uri) => meshes?.[uri]?.reason === 'no such file');
      expect(found(urdf, missing, meshes === undefined ? null : new Map(Object.entries(meshes)))).toEqual(
        findings,
      );
    },
  );

  it.each(CORPUS.filter(({ poses }) => poses !== undefined).map(({ urdf, poses }) => [urdf, poses!]))(
    'places what the edge places, whatever the version: %s',
    (text, poses) => {
      const { joints, links } = readUrdf(readXml(text));
      const placed = [
        ...joints,
        ...links.flatMap(({ visuals }) => visuals),
        ...links.flatMap(({ inertial }) => inertial ?? []),
      ];
      expect(placed).toHaveLength(poses.length);
      for (const [i, { xyz, rpy }] of placed.entries()) {
        const [w, ...rest] = quatOfRpy(rpy);
        for (const [k, value] of [
          ...xyz,
          ...(w < 0 ? [-w, ...rest.map((part) => -part)] : [w, ...rest]),
        ].entries())
          expect(value).toBeCloseTo(poses[i]![k]!, 9);
      }
    },
  );

  it('has no rule that the corpus does not hold to the other', () => {
    const folder = path.resolve(import.meta.dirname, '../../src/urdf');
    const rules = ['doctor.ts', 'doctor_meshes.ts', 'reader.ts', 'tree.ts']
      .map((name) => readFileSync(path.join(folder, name), 'utf8'))
      .flatMap((source) => [...source.matchAll(/'(?:error|warning|hint)',\s*'([a-z-]+)'/g)])
      .map((match) => match[1]);
    const shown = new Set(CORPUS.flatMap((robot) => robot.findings.map((row) => row[1])));
    expect(rules.length).toBeGreaterThan(40);
    expect(rules.filter((code) => !shown.has(code!))).toEqual([]);
  });

  it('names files that are not there once, whoever uses them', () => {
    const mesh = '<visual><geometry><mesh filename="a.stl"/></geometry></visual>';
    const paint = '<material name="m"><texture filename="t.png"/></material>';
    const urdf = `<robot name="r">\n<link name="a">${mesh}\n<visual><geometry><sphere radius="1"/></geometry>${paint}</visual></link>\n<link name="b">${mesh}</link>
<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>`;
    expect(found(urdf, ['a.stl', 't.png'])).toEqual([
      ['error', 'mesh-missing', "mesh 'a.stl' of link 'a' and others: no such file", 2],
      ['error', 'texture-missing', "texture 't.png' of link 'a': no such file", 3],
    ]);
  });
});

describe('XML from strangers', () => {
  it.each([
    [
      'a bomb of entities',
      '<!DOCTYPE r [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]>\n<robot/>',
      'a document type (DTD)',
      1,
    ],
    ['too many elements', `<robot>${'<a/>'.repeat(50_000)}</robot>`, 'more than 50000 elements', 1],
    ['too deep a nest', `\n${'<a>'.repeat(200_000)}`, 'nested more than 64 deep', 2],
    ['too long a text', ' '.repeat((8 << 20) + 1), 'larger than 8 MiB', null],
    ['SDF', '<sdf/>', 'this is SDF, not URDF', 1],
    ['something else', '<constructor/>', 'the root element is <constructor>, not <robot>', 1],
  ] as const)('%s is refused by name', (_, text, why, line) => {
    let refused: unknown;
    try {
      readUrdf(readXml(text));
    } catch (cause) {
      refused = cause;
    }
    expect(refused).toBeInstanceOf(XmlRefused);
    expect((refused as XmlRefused).message).toContain(why);
    expect((refused as XmlRefused).line).toBe(line);
  });

  it('does not stumble over tags that never end', () => {
    expect(() => readXml('<a '.repeat(200_000))).toThrow();
    expect(() => readXml(`<robot>${'<!-- '.repeat(300_000)}`)).toThrow();
  });
});

describe('words', () => {
  it('write numbers as Python does', () => {
    const written: [number, string][] = [
      [0, '0'],
      [1, '1'],
      [-90, '-90'],
      [0.1, '0.1'],
      [1e6, '1e+06'],
      [123456, '123456'],
      [1234567, '1.23457e+06'],
      [0.0001, '0.0001'],
      [0.00001234, '1.234e-05'],
      [999999.5, '1e+06'],
      [1 / 3, '0.333333'],
    ];
    for (const [value, text] of written) expect(general(value)).toBe(text);
    expect(general(1.0005, 3)).toBe('1');
  });

  it('never hand on control characters or endless names', () => {
    expect(quoted('a\u0000b\u202ec')).toBe("'a�b�c'");
    expect(quoted('x'.repeat(81))).toBe(`'${'x'.repeat(80)}…'`);
  });
});
