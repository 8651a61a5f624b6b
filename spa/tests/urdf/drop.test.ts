// @vitest-environment happy-dom
import { strToU8, zipSync } from 'fflate';
import { describe, expect, it } from 'vitest';
import { refusalWords } from '../../src/app/pages/local/local_files.ts';
import { moreEn } from '../../src/app/text/more_en.ts';
import { filesOf, localFiles } from '../../src/urdf/dropped_files.ts';
import { FileFinder } from '../../src/urdf/file_finder.ts';
import { type LocalFile, MAX_FILES, tidyPath } from '../../src/urdf/local_files.ts';
import { type LocalRobot, openLocal, urdfsIn } from '../../src/urdf/local_robot.ts';
import { unzip } from '../../src/urdf/unzip.ts';

const file = (content: string | Uint8Array): LocalFile => {
  const bytes = typeof content === 'string' ? strToU8(content) : content;
  return { size: bytes.length, bytes: async () => bytes };
};

const folder = (files: Record<string, string>) =>
  new Map(Object.entries(files).map(([path, content]) => [path, file(content)]));

const opened = async (files: ReadonlyMap<string, LocalFile>): Promise<LocalRobot> =>
  openLocal(files, (await urdfsIn(files))[0]!);

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
    const { manifest, findings } = await opened(files);
    expect(uris.map((uri) => manifest.files.get(uri)?.path)).toEqual([
      'top/meshes/a.stl',
      'top/meshes/a.stl',
      'top/meshes/a.stl',
      'top/meshes/b c.stl',
    ]);
    expect([...manifest.missing]).toEqual(['gone.stl']);
    expect(findings(null).map(({ text, line }) => [text, line])).toEqual([
      [
        "mesh 'gone.stl' of link 'a': no such file; looked for 'top/urdf/gone.stl' and any 'gone.stl' in the robot's folder",
        1,
      ],
    ]);
  });

  it.each([
    ['arm/urdf/r.urdf', 'package://arm/meshes/a.stl', null],
    ['ws/arm/urdf/r.urdf', 'package://arm/meshes/a.stl', null],
    ['arm/urdf/r.urdf', 'package://renamed/meshes/a.stl', 'not where it says; '],
  ])('%s: a package that is called like its folder needs no hint: %s', (path, uri, hint) => {
    const mesh = path.replace('urdf/r.urdf', 'meshes/a.stl');
    const found = new FileFinder(folder({ [path]: '<robot/>', [mesh]: 'x' }), path).find(uri);
    const expected = hint === null ? null : `${hint}'${mesh}' is taken from the model's own folder`;
    expect(found).toEqual({ path: mesh, hint: expected });
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

  it('of several URDFs, the one nearest to the top comes first, then the largest', async () => {
    const small = '<robot name="r"/>';
    const files = folder({
      'a/b/deep.urdf': small.repeat(9),
      'a/x.urdf': small,
      'a/y.URDF': small.repeat(2),
    });
    expect(await urdfsIn(files)).toEqual(['a/y.URDF', 'a/x.urdf', 'a/b/deep.urdf']);
  });

  it('has a slider for each joint that moves by itself, within limits that make sense', async () => {
    const link = (name: string) => `<link name="${name}"/>`;
    const joint = (name: string, child: string, type: string, inside = '') =>
      `<joint name="${name}" type="${type}"><parent link="a"/><child link="${child}"/>${inside}</joint>`;
    const urdf = `<robot name="r">${['a', 'b', 'c', 'd', 'e', 'f', 'g'].map(link).join('')}
      ${joint('turn', 'b', 'revolute', '<limit lower="0.2" upper="1"/>')}${joint('spin', 'c', 'continuous')}
      ${joint('slide', 'd', 'prismatic', '<limit lower="2" upper="1"/>')}${joint('still', 'e', 'fixed')}
      ${joint('copy', 'f', 'revolute', '<mimic joint="turn"/>')}${joint('free', 'g', 'floating')}</robot>`;
    const { joints } = await opened(folder({ 'r.urdf': urdf }));
    expect(joints).toEqual([
      { name: 'turn', unit: 'rad', lower: 0, upper: 1 },
      { name: 'spin', unit: 'rad', lower: -Math.PI, upper: Math.PI },
      { name: 'slide', unit: 'm', lower: -1, upper: 1 },
      { name: 'free/trans_x', unit: 'm', lower: -1, upper: 1 },
      { name: 'free/trans_y', unit: 'm', lower: -1, upper: 1 },
      { name: 'free/trans_z', unit: 'm', lower: -1, upper: 1 },
    ]);
  });

  it.each([
    ['no URDF', { 'a.stl': 'x', 'b.stl': 'y' }, 'These files include no .urdf.'],
    [
      'an entity',
      { 'r.urdf': '<!DOCTYPE r [<!ENTITY a "b">]><robot/>' },
      'r.urdf, line 1: a document type (DTD) is not accepted',
    ],
    ['another document', { 'r.urdf': '<html/>' }, 'r.urdf, line 1: this is an HTML page, not URDF'],
  ])('with %s is refused in one line', async (_, files, why) => {
    await expect(opened(folder(files as unknown as Record<string, string>))).rejects.toThrow(why);
  });
});

describe('a robot in a format that only the edge reads', () => {
  const refusal = (files: Record<string, string>) =>
    opened(folder(files)).then(
      () => 'shown',
      (cause: unknown) => refusalWords(cause),
    );

  it.each<[string, Record<string, string>, string, string, string]>([
    ['a template', { 'a/r.urdf.xacro': 'x' }, 'a/r.urdf.xacro', 'xacro', 'a/r.urdf.xacro'],
    ['SDF', { 'model.config': 'x', 'model.sdf': 'x' }, 'model.sdf', 'SDF', 'model.sdf'],
    ['SDF in a world', { 'r.world': '<?xml version="1.0"?>\n<sdf/>' }, 'r.world', 'SDF', 'r.world'],
    ['SDF that is called URDF', { 'r.urdf': '<sdf version="1.9"/>' }, 'r.urdf', 'SDF', 'r.urdf'],
    [
      'MJCF beside its scene and other XML',
      {
        'package.xml': '<package><!-- nothing of a robot, however long it is --></package>',
        'scene.xml': '<mujoco/>',
        '팔.xml': '<!-- <robot> --> <!-- - -->\n<mujoco model="arm"><compiler/></mujoco>',
      },
      '팔.xml',
      'MJCF',
      '팔.xml',
    ],
    ['a name that a shell would split', { 'my; arm.sdf': 'x' }, 'my; arm.sdf', 'SDF', 'FILE'],
    ['a name that looks like a flag', { '-o.sdf': 'x' }, '-o.sdf', 'SDF', 'FILE'],
  ])('%s: one line names it and the command that builds it', async (_, files, path, format, typed) => {
    expect(await refusal(files)).toBe(moreEn.dropOtherFormat(path, format, typed));
    expect(moreEn.dropOtherFormat(path, format, typed)).toContain(
      `“posecast model build ${typed} -o bundle”`,
    );
  });

  it.each([
    ['XML of something else', { 'a.xml': '<package/>' }],
    ['XML that is none', { 'a.xml': '<!-- <mujoco/>' }],
    ['XML with a document type', { 'a.xml': '<!DOCTYPE mujoco [<!ENTITY a "b">]><mujoco/>' }],
    ['nothing', { 'a.xml': '' }],
    ['a name that every object has', { 'a.xml': '<constructor/>' }],
  ])('%s is no robot', async (_, files) => {
    const beside = { ...(files as unknown as Record<string, string>), 'b.txt': 'x' };
    expect(await refusal(beside)).toBe(moreEn.dropNoUrdf);
  });

  it('a URDF beside them is what is shown', async () => {
    const files = {
      'r.sdf': '<sdf/>',
      'a/r.xacro': 'x',
      'a/b/r.urdf': '<robot name="r"><link name="a"/></robot>',
    };
    expect((await opened(folder(files))).path).toBe('a/b/r.urdf');
  });

  it('is found in a zip', async () => {
    const packed = zipSync({ 'r/model.sdf': strToU8('<sdf/>'), 'r/arm.xml': strToU8('<mujoco/>') });
    expect([...(await unzip(new File([packed as BlobPart], 'r.zip'))).keys()].sort()).toEqual([
      'r/arm.xml',
      'r/model.sdf',
    ]);
  });
});

describe('what is dropped', () => {
  const entry = (fullPath: string) =>
    ({
      isFile: true,
      fullPath,
      file: (take: (file: File) => void) => take(new File(['x'], fullPath)),
    }) as unknown as FileSystemEntry;
  /** A folder whose reader returns a hundred entries at a time, as in browsers. */
  const directory = (entries: FileSystemEntry[]) => {
    const readEntries = (take: (some: FileSystemEntry[]) => void) => take(entries.splice(0, 100));
    return { isFile: false, createReader: () => ({ readEntries }) } as unknown as FileSystemEntry;
  };

  it('is walked, folders of folders too, beside files that came without an entry', async () => {
    const meshes = Array.from({ length: 230 }, (_, i) => entry(`/arm/meshes/${i}.stl`));
    const top = directory([entry('/arm/arm.urdf'), directory(meshes)]);
    const found = await filesOf([top, new File(['y'], 'mail.zip')]);
    expect(found.size).toBe(232);
    expect([...found.keys()]).toEqual(
      expect.arrayContaining(['arm/arm.urdf', 'arm/meshes/229.stl', 'mail.zip']),
    );
  });

  it('is refused when it is more than a robot', async () => {
    const many = Array.from({ length: MAX_FILES + 1 }, (_, i) => entry(`/home/${i}`));
    await expect(filesOf([directory(many)])).rejects.toThrow('More than 5000 files');
  });
});

describe('what is no URDF', () => {
  const said = (files: Record<string, string>) =>
    opened(folder(files)).then(
      ({ urdf }) => urdf.name,
      (cause: Error) => cause.message,
    );
  const text = '<robot name="r"><link name="a"/></robot>';

  it.each<[string, Record<string, string>, string]>([
    ['the output of a tool', { 'echo.txt': `data: ${JSON.stringify(text)}\n---\n` }, 'r'],
    ['a parameter', { param: `String value is: ${text}` }, 'r'],
    ['a URDF called XML', { 'r.xml': text }, 'r'],
    [
      'USD',
      { 'a/r.usda': '#usda 1.0', 'a/x.png': 'x' },
      'a/r.usda: a USD file, not a robot description: export the robot as URDF',
    ],
    [
      'Webots',
      { 'w.wbt': '#VRML_SIM R2023b utf8', 'x.png': 'x' },
      'w.wbt: a Webots file, not a robot description: in Webots, right-click the robot and export it as URDF',
    ],
    [
      'SRDF',
      { 'r.srdf': '<robot><group name="a"/></robot>', 'x.png': 'x' },
      "r.srdf, line 1: this is an SRDF, MoveIt's file beside a URDF: give the URDF",
    ],
    [
      'a mesh',
      { 'a.obj': 'v 0 0 0' },
      'a.obj: an OBJ mesh, not a robot description: give the URDF that names it',
    ],
    [
      'a mesh called URDF',
      { 'r.urdf': 'solid a\nendsolid a', 'x.png': 'x' },
      'r.urdf: an STL mesh, not a robot description: give the URDF that names it',
    ],
  ])('%s is read, or called by its name', async (_, files, expected) => {
    expect(await said(files)).toBe(expected);
  });
});

describe('a zip of somewhere else', () => {
  const robotWith = (mesh: string) =>
    `<robot name="r"><link name="a"><visual><geometry><mesh filename="${mesh}"/></geometry></visual></link></robot>`;
  const GBK: Readonly<Record<string, number[]>> = { 机: [0xbb, 0xfa], 器: [0xc6, 0xf7], 人: [0xc8, 0xcb] };
  const utf8 = (name: string) => strToU8(name);
  const gbk = (name: string) =>
    Uint8Array.from([...name].flatMap((letter) => GBK[letter] ?? [letter.charCodeAt(0)]));
  const latin = (name: string) => strToU8(name, true);

  /** A zip of stored members whose names are written in an encoding, marked as UTF-8 or not. */
  function packed(
    members: Readonly<Record<string, string>>,
    {
      encode = utf8,
      flags = 0,
      method = 0,
    }: { encode?: (name: string) => Uint8Array; flags?: number; method?: number },
  ): Blob {
    const parts: Uint8Array[] = [];
    const list: Uint8Array[] = [];
    let at = 0;
    for (const [name, content] of Object.entries(members)) {
      const [path, data] = [encode(name), strToU8(content)];
      const head = new DataView(new ArrayBuffer(46));
      head.setUint32(0, 0x02014b50, true);
      head.setUint16(8, flags, true);
      head.setUint16(10, name.endsWith('.urdf') ? 0 : method, true);
      head.setUint32(20, data.length, true);
      head.setUint32(24, data.length, true);
      head.setUint16(28, path.length, true);
      head.setUint32(42, at, true);
      list.push(new Uint8Array(head.buffer), path);
      const local = new Uint8Array(30);
      local.set([0x50, 0x4b, 3, 4, 20, 0, ...new Uint8Array(head.buffer).subarray(8, 30)]);
      parts.push(local, path, data);
      at += 30 + path.length + data.length;
    }
    const end = new DataView(new ArrayBuffer(22));
    end.setUint32(0, 0x06054b50, true);
    end.setUint16(8, list.length / 2, true);
    end.setUint16(10, list.length / 2, true);
    end.setUint32(
      12,
      list.reduce((sum, { length }) => sum + length, 0),
      true,
    );
    end.setUint32(16, at, true);
    return new Blob([...parts, ...list, new Uint8Array(end.buffer)] as BlobPart[]);
  }

  it.each([
    ['plain names', 'arm', utf8, 0],
    ['UTF-8 that is marked', '机器人', utf8, 1 << 11],
    ['UTF-8 that is not marked', '机器人', utf8, 0],
    ['GBK', '机器人', gbk, 0],
    ['UTF-8 of accents, marked', 'Größe', utf8, 1 << 11],
    ['UTF-8 of accents, not marked', 'Größe', utf8, 0],
    ['decomposed accents, marked', 'Größe'.normalize('NFD'), utf8, 1 << 11],
    ['decomposed accents, not marked', 'Größe'.normalize('NFD'), utf8, 0],
    ['Hangul of a Mac', '로봇'.normalize('NFD'), utf8, 0],
    ['signs of URIs', 'a#b?c%20d', utf8, 0],
    ['Latin-1', 'é', latin, 0],
  ] as const)('names in %s are found', async (_, name, encode, flags) => {
    const zip = packed(
      {
        [`${name}/urdf/r.urdf`]: robotWith(`package://x/meshes/${name.normalize('NFC')}.stl`),
        [`${name}/meshes/${name}.stl`]: 'mesh',
      },
      { encode, flags },
    );
    const { manifest, path: urdf } = await opened(await unzip(zip));
    expect([...manifest.missing]).toEqual([]);
    expect(urdf).toBe(`${name}/urdf/r.urdf`);
  });

  it('what a Mac notes beside each file is no robot', async () => {
    const files = { 'm/r.urdf': robotWith('a.stl'), 'm/a.stl': 'x' };
    const forks = {
      '__MACOSX/m/._r.urdf': '\0',
      '__MACOSX/._m': '\0',
      'm/._a.stl': '\0',
      'm/.DS_Store': '\0',
    };
    expect([...(await unzip(packed({ ...forks, ...files }, {}))).keys()].sort()).toEqual([
      'm/a.stl',
      'm/r.urdf',
    ]);
    const dropped = new Map(Object.keys({ ...forks, ...files }).map((name) => [name, new File(['x'], name)]));
    expect([...(await localFiles(dropped)).keys()].sort()).toEqual(['m/a.stl', 'm/r.urdf']);
  });

  it.each([
    [12, 'bzip2'],
    [14, 'LZMA'],
    [93, 'Zstandard'],
    [42, 'method 42'],
  ])('a member packed in way %i is refused by name', async (method, name) => {
    const zip = packed({ 'r.urdf': robotWith('a.stl'), 'a.stl': 'x' }, { method });
    const cause = await unzip(zip).catch((error: unknown) => error);
    expect(refusalWords(cause).replace(/[\u2066-\u2069]/g, '')).toBe(
      `a.stl: packed with ${name}, which is not supported: pack the folder as an ordinary zip (Deflate)`,
    );
  });

  it.each(['ply', 'fbx', 'step', 'pdf'])('a file of another kind is not missing: .%s', async (suffix) => {
    const zip = packed({ 'r.urdf': robotWith(`a.${suffix}`), [`a.${suffix}`]: 'ply\n' }, {});
    const { findings, manifest, files } = await opened(await unzip(zip));
    const found = findings(null).map(({ text }) => text);
    if (suffix !== 'ply') {
      expect(found).toEqual([
        `mesh 'a.${suffix}' of link 'a': '.${suffix}' is not a supported mesh or picture format`,
      ]);
      return;
    }
    expect(found).toEqual([]);
    const { MeshLoader } = await import('../../src/scene/three/mesh_loader.ts');
    await expect(new MeshLoader(files).load(manifest.files.get('a.ply')!)).rejects.toThrow(
      'a.ply: a PLY mesh, which is not supported: export it as STL, Collada, OBJ or GLB',
    );
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
    expect([...files.keys()].sort()).toEqual(['r/meshes/a.stl', 'r/notes.pdf', 'r/r.urdf']);
    expect(files.get('r/notes.pdf')!.size).toBe(0);
    const { manifest, files: read } = await opened(files);
    expect(new TextDecoder().decode(await read.fetch(manifest.files.get('meshes/a.stl')!))).toBe('mesh');
  });

  it('whose members lead outside or are called strangely harms nobody', async () => {
    const files = await unzip(zipped({ '../../etc/x.stl': strToU8('x'), '__proto__.stl': strToU8('y') }));
    expect([...files.keys()]).toEqual(['__proto__.stl']);
  });

  it('that is a bomb is refused while it unpacks', async () => {
    const zeros = new Uint8Array(8_000_000);
    const bomb = zipped({ 'a.stl': zeros });
    expect(bomb.size).toBeLessThan(12_000);
    await expect(unzip(bomb)).rejects.toThrow('to over 100 times its size, at a.stl');
  });

  it('of too many members, or none, is refused', async () => {
    const many = Object.fromEntries(
      Array.from({ length: MAX_FILES + 1 }, (_, i) => [`${i}.txt`, new Uint8Array()]),
    );
    await expect(unzip(zipped(many))).rejects.toThrow('more than 5000 members');
    await expect(unzip(new Blob(['this is no zip at all']))).rejects.toThrow('This is not a zip file.');
  });
});
