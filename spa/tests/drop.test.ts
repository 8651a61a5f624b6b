// @vitest-environment happy-dom
import { strToU8, zipSync } from 'fflate';
import { describe, expect, it } from 'vitest';
import { diagnose } from '../src/drop/doctor.ts';
import { type LocalFile, localFiles, MAX_FILES, tidyPath } from '../src/drop/files.ts';
import { openLocal } from '../src/drop/local_robot.ts';
import { unzip } from '../src/drop/unzip.ts';

const file = (content: string | Uint8Array): LocalFile => {
  const bytes = typeof content === 'string' ? strToU8(content) : content;
  return { size: bytes.length, bytes: async () => bytes };
};

const folder = (files: Record<string, string>) =>
  new Map(Object.entries(files).map(([path, content]) => [path, file(content)]));

const robot = (inside: string) => `<robot name="r"><link name="a"/><link name="b"/>${inside}</robot>`;
const joint = (inside = '', type = 'revolute', name = 'j', parent = 'a', child = 'b') =>
  `<joint name="${name}" type="${type}"><parent link="${parent}"/><child link="${child}"/>${inside}</joint>`;
const LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>';

const words = (urdf: string, missing: string[] = []) =>
  diagnose(new DOMParser().parseFromString(urdf, 'text/xml').documentElement, missing, urdf).map(
    ({ text }) => text,
  );

describe('the doctor', () => {
  it('finds nothing in a sound robot', () => {
    expect(words(robot(joint(`<axis xyz="0 0 1"/>${LIMIT}`)))).toEqual([]);
  });

  it.each([
    ['a link that is not there', robot(joint(LIMIT, 'revolute', 'j', 'a', 'c')), 'names the link "c"'],
    ['doubled links', robot(`<link name="a"/>${joint(LIMIT)}`), 'Two links are called a.'],
    ['doubled joints', robot(joint(LIMIT) + joint(LIMIT)), 'Two joints are called j.'],
    ['two parents', robot(joint(LIMIT) + joint(LIMIT, 'revolute', 'k')), 'Link b has two parents.'],
    ['a circle', robot(joint(LIMIT) + joint(LIMIT, 'revolute', 'k', 'b', 'a')), 'the joints form a circle'],
    ['two roots', robot(''), 'There are 2 roots: a, b.'],
    ['no links', '<robot name="r"/>', 'There are no links.'],
    ['an unknown type', robot(joint(LIMIT, 'hinge')), 'of type "hinge"'],
    ['an axis of zero', robot(joint(`<axis xyz="0 0 0"/>${LIMIT}`)), 'is zero'],
    ['an axis of no numbers', robot(joint(`<axis xyz="0 x 1"/>${LIMIT}`)), 'is not three numbers'],
    ['a long axis', robot(joint(`<axis xyz="0 0 2"/>${LIMIT}`)), 'has length 2.000'],
    ['no limits', robot(joint()), 'has no limits'],
    ['limits the wrong way round', robot(joint('<limit lower="1" upper="-1"/>')), 'is above its upper'],
    ['limits that exclude zero', robot(joint('<limit lower="0.5" upper="1"/>')), 'exclude 0'],
    ['degrees', robot(joint('<limit lower="-90" upper="90"/>')), 'look like degrees'],
    ['millimetres', robot(joint(`<origin xyz="0 0 350"/>${LIMIT}`)), 'millimetres taken for metres?'],
    ['a mimic of nobody', robot(joint(`<mimic joint="x"/>${LIMIT}`)), 'mimics "x", which does not exist'],
    ['a mimic of itself', robot(joint(`<mimic joint="j"/>${LIMIT}`)), 'mimics itself in a circle'],
    ['a template', robot(`${joint(LIMIT)}<!-- $\{arm} -->`), 'xacro template'],
  ])('names %s', (_, urdf, why) => {
    expect(words(urdf).some((text) => text.includes(why))).toBe(true);
  });

  it('says the worst first', () => {
    const found = words(robot(joint('<axis xyz="0 0 2"/>') + joint(LIMIT, 'revolute', 'k', 'b', 'c')), [
      'x.stl',
    ]);
    expect(found[0]).toContain('names the link "c"');
    expect(found.at(-1)).toContain('has length');
  });
});

const MESH = (uri: string) => `<visual><geometry><mesh filename="${uri}"/></geometry></visual>`;
const shows = (...uris: string[]) =>
  `<robot name="r"><link name="a">${uris.map(MESH).join('')}</link></robot>`;

describe('a dropped robot', () => {
  it('finds its meshes whatever the package is called', async () => {
    const uris = [
      'package://my_robot/meshes/A.STL',
      'package:///other/meshes/a.stl',
      '../meshes/a.stl',
      'file:///home/x/meshes/b%20c.stl',
    ];
    const files = folder({
      'top/urdf/r.urdf': shows(...uris, 'gone.stl'),
      'top/meshes/a.stl': 'x',
      'top/meshes/b c.stl': 'y',
    });
    const { manifest, diagnoses } = await openLocal(files);
    expect(uris.map((uri) => manifest.files.get(uri)?.path)).toEqual([
      'top/meshes/a.stl',
      'top/meshes/a.stl',
      'top/meshes/a.stl',
      'top/meshes/b c.stl',
    ]);
    expect([...manifest.missing]).toEqual(['gone.stl']);
    expect(diagnoses.map(({ text }) => text)).toEqual(['The mesh gone.stl is not among the files.']);
  });

  it('never leaves what was dropped', () => {
    expect([
      tidyPath('a/./b//c'),
      tidyPath('a\\b'),
      tidyPath('a/../b'),
      tidyPath('../x'),
      tidyPath('a/../../x'),
    ]).toEqual(['a/b/c', 'a/b', 'b', null, null]);
  });

  it.each([
    ['no URDF', { 'a.stl': 'x' }, 'No .urdf among these files.'],
    ['only a template', { 'r.urdf.xacro': 'x' }, 'r.urdf.xacro is a template'],
    ['an entity', { 'r.urdf': '<!DOCTYPE r [<!ENTITY a "b">]><robot/>' }, 'r.urdf: a DTD is not accepted.'],
    ['another document', { 'r.urdf': '<html/>' }, 'r.urdf has no <robot>.'],
  ])('with %s is refused in one line', async (_, files, why) => {
    await expect(openLocal(folder(files as unknown as Record<string, string>))).rejects.toThrow(why);
  });
});

describe('a zip', () => {
  const zipped = (members: Record<string, Uint8Array>) => new Blob([new Uint8Array(zipSync(members))]);

  it('opens as its folder', async () => {
    const zip = zipped({
      'r/r.urdf': strToU8(shows('meshes/a.stl')),
      'r/meshes/a.stl': strToU8('mesh'),
      'r/notes.pdf': strToU8('no'),
    });
    const files = await localFiles(new Map([['r.zip', new File([zip], 'r.zip')]]));
    expect([...files.keys()].sort()).toEqual(['r/meshes/a.stl', 'r/r.urdf']);
    const opened = await openLocal(files);
    expect(new TextDecoder().decode(await opened.fetch(opened.manifest.files.get('meshes/a.stl')!))).toBe(
      'mesh',
    );
  });

  it('whose members lead outside or are called strangely harms nobody', async () => {
    const files = await unzip(zipped({ '../../etc/x.stl': strToU8('x'), '__proto__.stl': strToU8('y') }));
    expect([...files.keys()]).toEqual(['__proto__.stl']);
  });

  it('that is a bomb is refused while it unpacks', async () => {
    const zeros = new Uint8Array(40_000_000);
    const bomb = zipped({ 'a.stl': zeros });
    expect(bomb.size).toBeLessThan(60_000);
    await expect(unzip(bomb)).rejects.toThrow('to over 100 times its size, at a.stl');
  });

  it('of too many members, or none, is refused', async () => {
    const many = Object.fromEntries(
      Array.from({ length: MAX_FILES + 1 }, (_, i) => [`${i}.txt`, new Uint8Array()]),
    );
    await expect(unzip(zipped(many))).rejects.toThrow('more than 5000 members');
    await expect(unzip(new Blob(['this is no zip at all']))).rejects.toThrow('This is no zip.');
  });
});
