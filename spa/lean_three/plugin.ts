import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import type { Plugin } from 'vite';
import { KINDS, MACROS, MEMBERS, METHODS, PROPERTIES, STAND_INS, VERSION } from './left_out.ts';
import { type LeanShaders, leanShaders } from './shaders.ts';

/** Builds three.js from its modules instead of from the package's single file, without the parts listed in `left_out.ts`. Only in
 *  the build: the dev server and the unit tests use all of three.js. */
export function leanThree(scene: string): Plugin {
  const root = path.resolve(createRequire(import.meta.url).resolve('three'), '../..');
  const src = path.join(root, 'src/');
  let shaders: LeanShaders;
  const seen = new Set<string>();
  const listed = new Set([...Object.keys(MEMBERS), ...Object.keys(STAND_INS)]);
  return {
    name: 'lean-three',
    apply: 'build',
    enforce: 'pre',
    buildStart() {
      const { version } = JSON.parse(readFileSync(path.join(root, 'package.json'), 'utf8'));
      if (version !== VERSION)
        throw new Error(
          `three.js ${version}: the lists of lean_three/left_out.ts are for ${VERSION}: look through them and change VERSION there`,
        );
      shaders = leanShaders(src, scene);
    },
    resolveId: (name) => (name === 'three' ? path.join(src, 'Three.js') : null),
    load(id) {
      if (!id.startsWith(src)) return null;
      const file = id.slice(src.length);
      const [standIn, text] = [STAND_INS[file], readFileSync(id, 'utf8')];
      seen.add(file);
      if (standIn !== undefined) return standIn;
      if (file.endsWith('.glsl.js')) return shaders.module(file, text);
      if (file === 'renderers/shaders/ShaderChunk.js') return shaders.chunks(text);
      const members = MEMBERS[file];
      let lean = text;
      if (members !== undefined || METHODS.some((method) => text.includes(method)))
        lean = withoutMembers(text, [...METHODS, ...(members ?? [])], this.parse(text), file);
      if (file === 'renderers/webgl/WebGLProgram.js') lean = withoutMacros(lean);
      if (file === 'renderers/webgl/WebGLPrograms.js')
        lean = withoutParameters(
          lean,
          readFileSync(path.join(src, 'renderers/webgl/WebGLProgram.js'), 'utf8'),
        );
      return file.startsWith('renderers/') ? answered(lean) : lean;
    },
    buildEnd(error) {
      if (error !== undefined) return;
      const missing = [...listed].filter((file) => !seen.has(file));
      if (missing.length > 0)
        throw new Error(`lean_three/left_out.ts: not in three.js's renderer: ${missing.join(', ')}`);
    },
  };
}

/** Replaces checks with known results: the minifier then removes the code behind them. */
export function answered(text: string): string {
  const kinds = new RegExp(`(?<![\\w.])[\\w.]+\\.(?:${KINDS.join('|')})\\b(?!\\s*=[^=])`, 'g');
  const names = [...PROPERTIES.keys()].join('|').replaceAll('.', '\\.');
  const properties = new RegExp(`(?<![\\w.])(?:${names})\\b(?!\\s*=[^=])`, 'g');
  return text.replace(kinds, 'false').replace(properties, (name) => PROPERTIES.get(name)!);
}

/** Removes the lines that define macros that are never defined. */
function withoutMacros(text: string): string {
  return text.replace(/^.*\? '#define (\w+).*' : '',\n/gm, (line, name) =>
    MACROS.get(name) === null ? '' : line,
  );
}

/** Removes program parameters that are read only by such lines. */
function withoutParameters(text: string, program: string): string {
  const left = withoutMacros(program);
  const read = (of: string) => new Set([...of.matchAll(/parameters\.(\w+)/g)].map((match) => match[1]!));
  const gone = [...read(program)].filter((name) => !read(left).has(name));
  const names = `(?:${gone.join('|')})`;
  return text
    .replace(new RegExp(`^\\t\\t\\t${names}: .*,\\n`, 'gm'), '')
    .replace(new RegExp(`^\\t\\tarray\\.push\\( parameters\\.${names} \\);\\n`, 'gm'), '')
    .replace(new RegExp(`^\\t\\tif \\( parameters\\.${names} \\)\\n.*\\n`, 'gm'), '');
}

interface Node {
  readonly type: string;
  readonly start: number;
  readonly end: number;
  readonly [key: string]: unknown;
}

/** Removes methods, properties of literals, and functions set on `this`, by name. Throws Error if one is missing. */
export function withoutMembers(text: string, names: readonly string[], tree: unknown, file: string): string {
  const cuts: { start: number; end: number }[] = [];
  const missing = new Set(names.filter((name) => !METHODS.includes(name)));
  const visit = (node: unknown): void => {
    if (Array.isArray(node)) for (const each of node) visit(each);
    if (typeof node !== 'object' || node === null || !('type' in node)) return;
    const at = node as Node;
    const name = memberOf(at);
    if (name === null || !names.includes(name)) {
      for (const value of Object.values(at)) visit(value);
      return;
    }
    missing.delete(name);
    const comma = at.type === 'Property' ? (/^\s*,/.exec(text.slice(at.end))?.[0].length ?? 0) : 0;
    cuts.push({ start: at.start, end: at.end + comma });
  };
  visit(tree);
  if (missing.size > 0) throw new Error(`lean_three/left_out.ts: no ${[...missing].join(', ')} in ${file}`);
  let lean = text;
  for (const { start, end } of cuts.sort((a, b) => b.start - a.start))
    lean = lean.slice(0, start) + lean.slice(end);
  return lean;
}

/** The name of the member that a node declares; null for any other node. */
function memberOf(node: Node): string | null {
  const nameOf = (of: unknown) => (of as { name?: string } | undefined)?.name ?? null;
  if (node.type === 'MethodDefinition' || node.type === 'Property') return nameOf(node.key);
  if (node.type !== 'ExpressionStatement') return null;
  const { type, left } = node.expression as Node & { left?: Node };
  if (type !== 'AssignmentExpression' || left?.type !== 'MemberExpression') return null;
  return (left.object as Node).type === 'ThisExpression' ? nameOf(left.property) : null;
}
