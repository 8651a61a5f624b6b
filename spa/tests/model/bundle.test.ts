import { afterEach, expect, test, vi } from 'vitest';
import { BundleError, fileUrl, parseManifest } from '../../src/model/bundle.ts';
import { Download, readRawManifest } from '../../src/scene/three/raw_bundle.ts';

const URDF = { path: 'robot.urdf', uri: 'robot.urdf', size: 10, sha256: '00', type: 'application/xml' };

function manifest(changes: object): string {
  return JSON.stringify({ v: 1, urdf: 'robot.urdf', files: [URDF], missing: [], ...changes });
}

afterEach(() => vi.unstubAllGlobals());

test('a uri leads to an address beside the manifest, whatever is in its name', () => {
  const mesh = { path: 'meshes/left foot#1.stl', uri: 'package:///hubo/Left foot#1.STL', size: 3 };
  const { files, urdf, missing } = readRawManifest(
    parseManifest(manifest({ files: [URDF, mesh], missing: ['package://gone.stl'] })),
  );
  expect(urdf.size).toBe(10);
  expect(fileUrl('/api/v1/robots/hubo/model/ab/manifest.json', files.get(mesh.uri)!)).toBe(
    '/api/v1/robots/hubo/model/ab/meshes/left%20foot%231.stl',
  );
  expect([...missing]).toEqual(['package://gone.stl']);
});

test.each([
  ['no JSON', '<html>', 'not JSON'],
  ['no object', '[]', 'not an object'],
  ['another version', manifest({ v: 3 }), 'neither version 1 nor 2'],
  ['no files', manifest({ files: 'x' }), 'no list of files'],
  ['no URDF among the files', manifest({ urdf: 'other.urdf' }), 'its files include no URDF'],
  ['a path out of the bundle', manifest({ files: [{ ...URDF, path: '../../secret' }] }), 'file 0: bad path'],
  ['an absolute path', manifest({ files: [{ ...URDF, path: '/etc/passwd' }] }), 'file 0: bad path'],
  ['no uri', manifest({ files: [{ ...URDF, uri: 7 }] }), 'file 0: no uri'],
  ['a size that is none', manifest({ files: [{ ...URDF, size: -1 }] }), 'file 0 (robot.urdf): bad size'],
  ['a giant', manifest({ files: [{ ...URDF, size: 1e15 }] }), 'file 0 (robot.urdf): bad size'],
])('%s is refused in one line', (_, text, why) => {
  expect(() => readRawManifest(parseManifest(text))).toThrow(new BundleError(`model manifest: ${why}`));
});

/** A host whose answers are held back until released. */
function host(bodies: Record<string, Uint8Array | number>) {
  const open: (() => void)[] = [];
  const asked: string[] = [];
  vi.stubGlobal('fetch', async (url: string) => {
    asked.push(url);
    await new Promise<void>((resolve) => open.push(resolve));
    const body = bodies[url] ?? 404;
    return typeof body === 'number'
      ? new Response('no', { status: body })
      : new Response(new Uint8Array(body));
  });
  return {
    asked,
    letGo: () => {
      for (const go of open.splice(0)) go();
    },
  };
}

test('at most six files are on their way, and bytes are counted over all', async () => {
  const names = Array.from({ length: 9 }, (_, i) => `m${i}.stl`);
  const files = names.map((path) => ({ path, uri: path, size: 100 }));
  const { asked, letGo } = host(Object.fromEntries(names.map((name) => [`/b/${name}`, new Uint8Array(100)])));
  const counts: number[] = [];
  const download = new Download('/b/manifest.json', new AbortController().signal, (n) => counts.push(n));
  const all = Promise.all(files.map((file) => download.fetch(file)));
  await vi.waitFor(() => expect(asked.length).toBe(6));
  letGo();
  await vi.waitFor(() => expect(asked.length).toBe(9));
  letGo();
  expect((await all).map((bytes) => bytes.length)).toEqual(names.map(() => 100));
  expect(counts.at(-1)).toBe(900);
  expect(counts).toEqual([...counts].sort((a, b) => a - b));
});

test.each([
  ['absent', 404, 'x.stl: answered 404'],
  ['too long', new Uint8Array(12), 'x.stl: longer than 10 bytes'],
  ['too short', new Uint8Array(4), 'x.stl: 4 bytes instead of 10'],
])('a file that is %s is an error, and the count still reaches the end', async (_, body, why) => {
  const { letGo } = host({ '/b/x.stl': body });
  let count = 0;
  const download = new Download('/b/manifest.json', new AbortController().signal, (n) => {
    count = n;
  });
  const lost = expect(download.fetch({ path: 'x.stl', uri: 'x.stl', size: 10 })).rejects.toThrow(why);
  await vi.waitFor(() => letGo());
  await lost;
  expect(count).toBe(10);
});
