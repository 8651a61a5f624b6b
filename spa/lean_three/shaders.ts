import { readdirSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { MACROS, MEMBERS, SHADER_ROOTS } from './left_out.ts';
import { functionsIn, withoutDeadBranches, withoutSpaces } from './shader_text.ts';

/** three.js's shader modules, reduced to what the scene's materials can reach. */
export interface LeanShaders {
  /** The text of a module with one or more shaders. */
  module(file: string, text: string): string;
  /** The text of `ShaderChunk.js`, which lists all of them by name. */
  chunks(text: string): string;
}

const FOLDER = 'renderers/shaders/';
const LITERAL = /\/\* glsl \*\/\s*`([^`]*)`/g;
const INCLUDE = /^[ \t]*#include +<([\w\d./]+)>[ \t]*\n?/gm;

/** `src`: three.js's sources; `scene`: the folder with the scene's sources, whose text shows what it uses. */
export function leanShaders(src: string, scene: string): LeanShaders {
  const own = sourcesIn(scene);
  const reduced = (text: string) => withoutDeadBranches(text, MACROS);
  const files = new Map<string, string[]>();
  const namesOf = new Map<string, string>();
  for (const folder of ['ShaderChunk', 'ShaderLib']) {
    for (const name of readdirSync(path.join(src, FOLDER, folder))) {
      const file = `${FOLDER}${folder}/${name}`;
      const text = readFileSync(path.join(src, file), 'utf8');
      files.set(
        file,
        [...text.matchAll(LITERAL)].map((match) => reduced(match[1]!)),
      );
      namesOf.set(name.replace('.glsl.js', ''), file);
    }
  }
  const kept = reachable(src, own, files, namesOf);
  const everything = () => [...kept].flatMap((name) => files.get(namesOf.get(name)!)!).join('\n');
  // An empty chunk is no longer included, unless the scene puts its own code there.
  const empty = [...kept].filter(
    (name) => files.get(namesOf.get(name)!)!.every((text) => withoutSpaces(text) === '') && !named(own, name),
  );
  for (const [file, texts] of files) {
    files.set(
      file,
      texts.map((text) => text.replace(INCLUDE, (line, name) => (empty.includes(name) ? '' : line))),
    );
  }
  for (const name of empty) kept.delete(name);
  for (let before = ''; before !== everything(); ) {
    before = everything();
    const calls = (name: string) => (before.match(new RegExp(`\\b${name}\\b`, 'g')) ?? []).length;
    for (const [name, bodies] of functionsIn(before)) {
      if (SHADER_ROOTS.includes(name) || named(own, name) || calls(name) > bodies.length) continue;
      for (const chunk of kept) {
        const file = namesOf.get(chunk)!;
        files.set(
          file,
          files.get(file)!.map((text) => bodies.reduce((rest, body) => rest.replace(body, ''), text)),
        );
      }
    }
  }
  return {
    module(file, text) {
      const texts = files.get(file)!;
      let at = 0;
      return text.replace(LITERAL, () => `\`${withoutSpaces(texts[at++]!)}\``);
    },
    chunks(text) {
      return text
        .replace(/^import (?:\* as )?(\w+) from .*\n/gm, (line, name) => (kept.has(name) ? line : ''))
        .replace(/^\t(\w+)(?:_vert|_frag): (\w+)\.\w+,?\n/gm, (line, name) => (kept.has(name) ? line : ''))
        .replace(/^\t(\w+): (\w+),?\n/gm, (line, _, name) => (kept.has(name) ? line : ''));
    },
  };
}

/** The names of the modules reachable from the kept entries of `ShaderLib.js`, the renderer and the scene. */
function reachable(
  src: string,
  own: string,
  files: ReadonlyMap<string, readonly string[]>,
  namesOf: ReadonlyMap<string, string>,
): Set<string> {
  const unused = MEMBERS[`${FOLDER}ShaderLib.js`]!;
  const library = readFileSync(path.join(src, FOLDER, 'ShaderLib.js'), 'utf8');
  const wanted = [...library.matchAll(/ShaderChunk\.(\w+)_(?:vert|frag)/g)].map((match) => match[1]!);
  const materials = wanted.filter((name) => !unused.includes(name.replace(/^mesh|^line/, '')));
  const all = new Set<string>();
  const add = (name: string) => {
    const file = namesOf.get(name);
    if (file === undefined || all.has(name)) return;
    all.add(name);
    for (const text of files.get(file)!) for (const match of text.matchAll(INCLUDE)) add(match[1]!);
  };
  for (const name of materials) add(name);
  for (const name of ['vsm', 'tonemapping_pars_fragment', 'colorspace_pars_fragment']) add(name);
  for (const name of namesOf.keys())
    if (/_/.test(name) || name === 'common' ? named(own, name) : false) add(name);
  for (const match of own.matchAll(/#include <(\w+)>/g)) add(match[1]!);
  return all;
}

function named(text: string, name: string): boolean {
  return new RegExp(`\\b${name}\\b`).test(text);
}

function sourcesIn(folder: string): string {
  return readdirSync(folder, { recursive: true, encoding: 'utf8' })
    .filter((file) => file.endsWith('.ts') && !/(\.test|sample)\.ts$/.test(file))
    .map((file) => readFileSync(path.join(folder, file), 'utf8'))
    .join('\n');
}
