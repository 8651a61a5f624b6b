import { readdirSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';

/** The rooms of `src/`, each with those that it may import from; `main.tsx` and `early.ts` may import from all. */
const ROOMS: Readonly<Record<string, readonly string[]>> = {
  'kit.ts': [],
  'zip.ts': [],
  browser: ['kit.ts'],
  twin: ['kit.ts'],
  relay: ['browser', 'kit.ts'],
  model: ['kit.ts', 'relay', 'twin'],
  stream: ['kit.ts', 'relay', 'twin'],
  past: ['browser', 'kit.ts', 'model', 'relay', 'twin', 'zip.ts'],
  urdf: ['kit.ts', 'model', 'zip.ts'],
  'scene/signs': ['browser', 'model', 'twin'],
  'scene/camera': ['browser', 'model', 'twin'],
  'scene/figure': ['browser', 'kit.ts', 'model', 'scene/camera', 'scene/signs', 'twin'],
  'scene/canvas2d': ['browser', 'kit.ts', 'model', 'scene/camera', 'scene/figure', 'scene/signs', 'twin'],
  'scene/three': [
    'browser',
    'kit.ts',
    'model',
    'scene/camera',
    'scene/figure',
    'scene/signs',
    'twin',
    'urdf',
  ],
  app: [
    ...['browser', 'kit.ts', 'model', 'past', 'relay', 'stream', 'twin', 'urdf'],
    ...['scene/camera', 'scene/canvas2d', 'scene/figure', 'scene/signs', 'scene/three'],
  ],
};

/** Rooms that must not reach three.js or React, even indirectly. */
const PLAIN = Object.keys(ROOMS).filter((room) => room !== 'scene/three' && room !== 'app');

/** In three.js's addons, without imports. */
const DECODER = 'three/addons/libs/meshopt_decoder.module.js';

const SRC = path.resolve(import.meta.dirname, '../src');

/** Every source file with its imports: files as paths below `src/`, packages by name. Types and lazy imports count. */
function importGraph(): Map<string, string[]> {
  const files = readdirSync(SRC, { recursive: true, encoding: 'utf8' }).filter((file) =>
    /\.tsx?$/.test(file),
  );
  return new Map(
    files.map((file) => {
      const source = readFileSync(path.join(SRC, file), 'utf8');
      const named = [...source.matchAll(/\b(?:from|import)\s*\(?\s*'([^']+)'/g)].map((match) => match[1]!);
      return [file, named.map((name) => (name.startsWith('.') ? path.join(path.dirname(file), name) : name))];
    }),
  );
}

/** The members of one cycle, in order; null when there is none. */
function cycleIn(graph: ReadonlyMap<string, Iterable<string>>): string[] | null {
  const done = new Set<string>();
  const way: string[] = [];
  const visit = (at: string): string[] | null => {
    if (way.includes(at)) return way.slice(way.indexOf(at));
    if (done.has(at)) return null;
    way.push(at);
    for (const next of graph.get(at) ?? []) {
      const found = visit(next);
      if (found !== null) return found;
    }
    way.pop();
    done.add(at);
    return null;
  };
  for (const start of graph.keys()) {
    const found = visit(start);
    if (found !== null) return found;
  }
  return null;
}

describe('the import graph of src/', () => {
  const graph = importGraph();
  const roomOf = (file: string) => file.split('/', file.startsWith('scene/') ? 2 : 1).join('/');
  const folderOf = (file: string) => (file.includes('/') ? path.dirname(file) : file);

  it('covers every source file', () => {
    expect(graph.size).toBeGreaterThan(250);
    const unknown = [...graph.values()].flat().filter((to) => /\.tsx?$/.test(to) && !graph.has(to));
    expect(unknown).toEqual([]);
  });

  it('has no cycle between files', () => {
    expect(cycleIn(graph)).toBeNull();
  });

  it('has no cycle between folders', () => {
    const folders = new Map<string, Set<string>>();
    for (const [file, imported] of graph) {
      const from = folderOf(file);
      const to = imported.filter((each) => graph.has(each)).map(folderOf);
      folders.set(from, new Set([...(folders.get(from) ?? []), ...to.filter((each) => each !== from)]));
    }
    expect(cycleIn(folders)).toBeNull();
  });

  it('leads from each room only to those below it', () => {
    const forbidden: string[] = [];
    for (const [file, imported] of graph) {
      const room = roomOf(file);
      if (!file.includes('/')) continue;
      for (const to of imported) {
        if (graph.has(to) && roomOf(to) !== room && !ROOMS[room]?.includes(roomOf(to)))
          forbidden.push(`${file} imports ${to}`);
      }
    }
    expect(forbidden).toEqual([]);
  });

  it.each(PLAIN)('leads from %s to neither three.js nor React', (room) => {
    const reached = new Set<string>();
    const waiting = [...graph.keys()].filter((file) => roomOf(file) === room);
    for (let at = waiting.pop(); at !== undefined; at = waiting.pop()) {
      if (reached.has(at)) continue;
      reached.add(at);
      waiting.push(...(graph.get(at) ?? []));
    }
    const packages = [...reached].filter((name) => !graph.has(name) && name !== DECODER);
    expect(packages.filter((name) => /^(three|react|react-dom)(\/|$)/.test(name))).toEqual([]);
  });
});
