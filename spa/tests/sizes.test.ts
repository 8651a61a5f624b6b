import { existsSync, readdirSync, readFileSync, statSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { describe, expect, it } from 'vitest';

/** What a visitor downloads, in kB (1000 bytes), as the build has packed it. The limits are what this page took in November 2026 plus
 *  two percent: they catch a library or a late part that became part of the page by accident, and grow with features. */
const LIMITS = {
  'the page, with the worker of its stream': { gzip: 131, br: 114.5 },
  'the page with the numbers': { gzip: 144, br: 126 },
  'the page with the list, without a worker': { gzip: 125.5, br: 109 },
  'the first 3D view': { gzip: 325, br: 276 },
  'the first light view': { gzip: 169.5, br: 148.5 },
};
/** Reads segments as a stream, with a decoder of its own. */
const LANE_KB = 15;
/** Firebase. */
const SIGN_IN_KB = 40;

const dist = fileURLToPath(new URL('../dist/', import.meta.url));
const built = existsSync(`${dist}.vite/manifest.json`);

interface Chunk {
  readonly name?: string;
  readonly file: string;
  readonly imports?: readonly string[];
  readonly css?: readonly string[];
}

describe.skipIf(!built)('bundle (skipped when spa/dist is not built)', () => {
  const chunks = (): Record<string, Chunk> => JSON.parse(readFileSync(`${dist}.vite/manifest.json`, 'utf8'));
  const read = (file: string) => readFileSync(`${dist}${file}`);
  const kb = (file: string, by: 'gz' | 'br') => statSync(`${dist}${file}.${by}`).size / 1000;
  const scripts = () => readdirSync(`${dist}assets`).filter((file) => file.endsWith('.js'));

  /** The files of these chunks and of all that they import at once. */
  const filesOf = (...names: string[]): Set<string> => {
    const all = chunks();
    const files = new Set<string>();
    const add = (name: string) => {
      const chunk =
        all[name] ?? Object.values(all).find((each) => each.name === name && /js$/.test(each.file));
      if (chunk === undefined) throw new Error(`no chunk of ${name}`);
      if (files.has(chunk.file)) return;
      for (const file of [chunk.file, ...(chunk.css ?? [])]) files.add(file);
      chunk.imports?.forEach(add);
    };
    names.forEach(add);
    return files;
  };

  const theOne = (name: RegExp): string => {
    const found = scripts().filter((file) => name.test(file));
    expect(found).toHaveLength(1);
    return `assets/${found[0]}`;
  };

  const PAGE = ['index.html', 'src/early.ts'];

  it('has no files that wait for each other: each would find the other half done', () => {
    const imported = (file: string) =>
      [
        ...read(`assets/${file}`)
          .toString()
          .matchAll(/(?:from|import)\s*"\.\/([^"]+\.js)"/g),
      ].map(([, name]) => name!);
    const done = new Set<string>();
    const follow = (file: string, way: readonly string[]) => {
      expect(way, 'a circle of files').not.toContain(file);
      if (done.has(file)) return;
      for (const next of imported(file)) follow(next, [...way, file]);
      done.add(file);
    };
    for (const file of scripts()) follow(file, []);
    expect(done.size).toBeGreaterThan(20);
  });

  it.each<[keyof typeof LIMITS, readonly string[]]>([
    ['the page, with the worker of its stream', []],
    ['the page with the numbers', ['numbers']],
    ['the page with the list, without a worker', ['src/app/pages/list/RobotList.tsx']],
    ['the first 3D view', ['three']],
    ['the first light view', ['light']],
  ])('%s is within its limit', (name, parts) => {
    const files = [...filesOf(...PAGE, ...parts)];
    if (!name.includes('without a worker')) files.push(theOne(/^worker-/));
    const sumOf = (by: 'gz' | 'br') => files.reduce((sum, file) => sum + kb(file, by), 0);
    const [gzip, br] = [sumOf('gz'), sumOf('br')];
    const { length } = files;
    console.info(`${name}: ${gzip.toFixed(1)} kB with gzip, ${br.toFixed(1)} with Brotli, ${length} files`);
    expect(gzip).toBeLessThan(LIMITS[name].gzip);
    expect(br).toBeLessThan(LIMITS[name].br);
    const has3d = files.some((file) => read(file).includes('WebGLRenderer'));
    expect(has3d, 'three.js comes with the 3D view, and only with that').toBe(name === 'the first 3D view');
  });

  it('the early script waits for no other', () => {
    expect([...filesOf('src/early.ts')]).toHaveLength(1);
  });

  it('has no more files than it needs', () => {
    expect(scripts().length).toBeLessThan(60);
  });

  it('nothing imports from the worker: WebKit would run it a second time, beside the first', () => {
    const importsIt = (file: string) =>
      /(from|import)\s*["'`]\.\/worker-/.test(read(`assets/${file}`).toString());
    expect(scripts().filter(importsIt)).toEqual([]);
  });

  it('who reads in the lane gets one file more, which imports nothing', () => {
    const lane = theOne(/^lane_script-/);
    expect(kb(lane, 'gz')).toBeLessThan(LANE_KB);
    expect(read(lane).toString()).not.toMatch(/\bimport\b/);
  });

  it('signing in comes to nobody who does not sign in, in 40 kB', () => {
    const account = chunks()['src/relay/account.ts']?.file ?? 'no such chunk';
    expect(read(account).toString()).toContain('identitytoolkit');
    expect(kb(account, 'gz')).toBeLessThan(SIGN_IN_KB);
    for (const file of filesOf(...PAGE, 'src/app/pages/list/RobotList.tsx'))
      expect(read(file).toString()).not.toContain('signInWithPassword');
  });

  it('saving and balance come to nobody who asks for neither', () => {
    const files = filesOf(...PAGE, 'numbers', 'three', 'body', 'recording');
    for (const name of ['src/past/save/save.ts', 'balance']) {
      const [own] = filesOf(name);
      expect(files).not.toContain(own);
    }
  });
});
