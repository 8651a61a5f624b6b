import { readdirSync, readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import fc from 'fast-check';
import { describe, expect, it } from 'vitest';
import { KINDS, MACROS, PROPERTIES, USED_BY_THE_SCENE } from '../lean_three/left_out.ts';
import { answered, withoutMembers } from '../lean_three/plugin.ts';
import {
  functionsIn,
  type KnownMacros,
  withoutDeadBranches,
  withoutSpaces,
} from '../lean_three/shader_text.ts';
import { leanShaders } from '../lean_three/shaders.ts';

const SCENE = path.resolve(import.meta.dirname, '../src/three');
const THREE = path.resolve(createRequire(import.meta.url).resolve('three'), '../../src/');

const sources = readdirSync(SCENE, { recursive: true, encoding: 'utf8' })
  .filter((file) => file.endsWith('.ts') && !/(\.test|sample)\.ts$/.test(file))
  .map((file) => [file, readFileSync(path.join(SCENE, file), 'utf8')] as const);
/** The mesh readers create objects of many kinds, but pass on only their surfaces and colours. */
const drawing = sources.filter(([file]) => file !== 'robot/mesh_loader.ts');

/** The tokens of a shader, as its compiler sees them. */
const tokens = (glsl: string) =>
  glsl
    .replace(/\/\*[\s\S]*?\*\/|\/\/[^\n]*/g, ' ')
    .match(/\w+(?:\.\w*)?|\+\+|--|&&|\|\||[<>=!*/+-]=|[^\s\w]/g);

/** All macros decided: unlisted ones are undefined. */
const decided = (glsl: string, defined: KnownMacros) => {
  const names = new Set(glsl.match(/\b[A-Za-z_]\w*/g));
  const all = [...names].map((name) => [name, defined.get(name) ?? null] as const);
  return withoutDeadBranches(glsl, new Map(all));
};

describe('what the scene uses of three.js', () => {
  it('is listed, and nothing else is', () => {
    const imported = drawing.flatMap(([, text]) =>
      [...text.matchAll(/import (?:type )?\{([^}]*)\} from 'three';/g)].flatMap((match) =>
        match[1]!.split(',').map((name) => name.replace(/\btype\b/, '').trim()),
      ),
    );
    const used = [...new Set(imported)].filter((name) => name !== '').sort();
    const told =
      'src/three imports something else than USED_BY_THE_SCENE in lean_three/left_out.ts lists: ' +
      'add it there, and take off the other lists what it needs';
    expect(used, told).toEqual([...USED_BY_THE_SCENE].sort());
  });

  it('is none of the kinds that the build takes for never made', () => {
    for (const name of [...USED_BY_THE_SCENE, 'MeshDepthMaterial', 'DepthTexture', 'RenderTarget'])
      expect(KINDS, 'the scene makes it: take it off KINDS in lean_three/left_out.ts').not.toContain(
        `is${name}`,
      );
  });

  it('is left out only where the renderer asks for it: no name is listed in vain', () => {
    const renderer = readdirSync(path.join(THREE, 'renderers'), { recursive: true, encoding: 'utf8' })
      .filter((file) => /^(WebGLRenderer\.js|webgl\/.*\.js|shaders\/.*\.js)$/.test(file))
      .map((file) => readFileSync(path.join(THREE, 'renderers', file), 'utf8'))
      .join('\n');
    const forms = [
      ...KINDS.map((name) => [name, `\\.${name}\\b`] as const),
      ...[...PROPERTIES.keys()].map(
        (name) => [name, `(?<![\\w.])${name.replaceAll('.', '\\.')}\\b`] as const,
      ),
      ...[...MACROS.keys()].map((name) => [name, `\\b${name}\\b`] as const),
    ];
    const unknown = forms.filter(([, form]) => !new RegExp(form).test(renderer)).map(([name]) => name);
    expect(unknown, 'three.js does not ask for these: take them off lean_three/left_out.ts').toEqual([]);
  });

  it('sets nothing that the build takes for never set', () => {
    const properties = [...PROPERTIES.keys()].map((name) => name.split('.').at(-1)!);
    // `position`, `normal` and `color` exist in every geometry.
    const names = [
      ...properties,
      ...[
        'clippingPlanes',
        'localClippingEnabled',
        'logarithmicDepthBuffer',
        'reversedDepthBuffer',
        'sizeAttenuation',
      ],
      ...['alphaToCoverage', 'instanceColor', 'morphTexture', 'clipCullDistance', 'extensions'],
    ].filter((name) => !['position', 'normal', 'color'].includes(name));
    const set = new RegExp(`(?<![#\\w])(${names.join('|')})\\s*(?:=[^=]|:)`);
    for (const [file, text] of drawing)
      expect(set.exec(text)?.[1], `${file}: see lean_three/left_out.ts`).toBeUndefined();
  });
});

describe('macros', () => {
  const renderer = (name: string) => readFileSync(path.join(THREE, `renderers/webgl/${name}.js`), 'utf8');
  const programs = answered(renderer('WebGLPrograms'));
  /** What the page's materials, objects, lights and renderer leave unset (see above), and a stand-in's results. */
  const unset =
    /^(alphaToCoverage|sizeAttenuation|(logarithmic|reversed)DepthBuffer|instancing(Color|Morph)|extensionClipCullDistance|numLightProbes|morphTargetsCount|envMap|envMapPMREM|decodeVideoTexture)$/;

  /** Whether an expression in the renderer is falsy whatever it reads. */
  const isFalse = (expression: string): boolean => {
    const constant = (name: string) => {
      const value = new RegExp(`const ${name} = ([^;]+);`).exec(programs)?.[1];
      return value === undefined ? name : `( ${value} )`;
    };
    let text = expression;
    for (let depth = 0; depth < 3; depth += 1) text = text.replace(/(?<![.\w])[A-Za-z_]\w*/g, constant);
    try {
      return !new Function(`return ${text}`)();
    } catch {
      return false;
    }
  };

  it('are never defined because the parameters that define them are never set', () => {
    const lines = [...renderer('WebGLProgram').matchAll(/^(.*parameters\..*)\? '#define (\w+)/gm)];
    expect(lines.length).toBeGreaterThan(100);
    for (const [, condition = '', macro = ''] of lines) {
      if (MACROS.get(macro) !== null) continue;
      const named = [...condition.matchAll(/parameters\.(\w+)/g)].map((match) => match[1]!);
      const textOf = (name: string) =>
        new RegExp(`^\\t\\t\\t${name}: ([\\s\\S]*?),\\n`, 'm').exec(programs)?.[1] ?? 'true';
      const never = named.some((name) => unset.test(name) || isFalse(textOf(name)));
      expect(never, `${macro}, by ${named}: ${named.map(textOf)}`).toBe(true);
    }
  });
});

describe('shaders', () => {
  const shaders = leanShaders(`${THREE}/`, SCENE);
  const list = readFileSync(path.join(THREE, 'renderers/shaders/ShaderChunk.js'), 'utf8');
  const kept = [...shaders.chunks(list).matchAll(/^import .* from '.\/(.*)';$/gm)].map((match) => match[1]!);
  const both = kept.map((name) => {
    const file = `renderers/shaders/${name}`;
    const text = readFileSync(path.join(THREE, file), 'utf8');
    return [name, text, shaders.module(file, text)] as const;
  });
  const literals = (text: string) => text.split('`').filter((_, i) => i % 2 === 1);

  it('lose two thirds of their text', () => {
    const size = (at: 1 | 2) => both.reduce((sum, part) => sum + part[at].length, 0);
    expect(kept.length).toBeGreaterThan(30);
    expect(size(2)).toBeLessThan(size(1) / 3);
  });

  it('define none of the macros that are taken for never defined', () => {
    for (const [name, , lean] of both)
      for (const [, macro] of lean.matchAll(/#define (\w+)/g))
        expect(MACROS.has(macro!), `${name}: ${macro}`).toBe(false);
  });

  it('are the same to a compiler, but for functions that nobody calls', () => {
    for (const [name, whole, lean] of both) {
      for (const [i, text] of literals(lean).entries()) {
        const before = decided(literals(whole)[i]!, new Map([...MACROS, ['DITHERING', 1], ['STANDARD', 1]]));
        const dropped = [...functionsIn(before)].filter(([of]) => !new RegExp(`\\b${of}\\s*\\(`).test(text));
        const rest = dropped
          .flatMap(([, bodies]) => bodies)
          .reduce((all, body) => all.replace(body, ''), before);
        const asked = new Set(text.match(/#include <\w+>/g));
        const reduced = rest.replace(/#include <\w+>/g, (line) => (asked.has(line) ? line : ''));
        expect(
          tokens(
            decided(
              text,
              new Map([
                ['DITHERING', 1],
                ['STANDARD', 1],
              ]),
            ),
          ),
          name,
        ).toEqual(tokens(reduced));
      }
    }
  });
});

describe('branches', () => {
  it('go where their condition is known, and are asked for less where it is known in part', () => {
    const known = new Map([
      ['A', null],
      ['N', 0],
      ['T', 2],
    ]);
    const lean = (...lines: string[]) => withoutDeadBranches(lines.join('\n'), known).split('\n');
    expect(lean('#ifdef A', 'a', '#else', 'b', '#endif')).toEqual(['b']);
    expect(lean('#ifndef A', 'a', '#endif')).toEqual(['a']);
    expect(lean('#if N > 0', 'a', '#elif defined( B )', 'b', '#else', 'c', '#endif')).toEqual([
      ...['#if defined( B )', 'b', '#else', 'c', '#endif'],
    ]);
    expect(lean('#if defined( B )', 'b', '#elif T == 2', 'c', '#else', 'd', '#endif')).toEqual([
      ...['#if defined( B )', 'b', '#else', 'c', '#endif'],
    ]);
    expect(lean('#if ( defined( B ) && T > 1 ) || defined ( A )', 'a', '#endif')).toEqual([
      ...['#if defined( B )', 'a', '#endif'],
    ]);
    expect(lean('#ifdef A', '#ifdef B', 'a', '#else', 'b', '#endif', '#endif', 'c')).toEqual(['c']);
    expect(() => lean('#if defined( A', '#endif')).toThrow('not understood');
    expect(() => lean('#endif')).toThrow('#endif without #if');
    expect(() => lean('#ifdef B')).toThrow('#if without #endif');
  });

  it('say the same as before, whatever the rest of the macros', () => {
    const names = ['A', 'B', 'C', 'D'];
    const word = fc.oneof(
      fc.constantFrom(...names).map((name) => `defined( ${name} )`),
      fc
        .tuple(fc.constantFrom(...names), fc.constantFrom('>', '==', '<='), fc.nat(2))
        .map((parts) => parts.join(' ')),
    );
    const condition = fc.letrec<{ test: string }>((tie) => ({
      test: fc.oneof(
        { maxDepth: 3 },
        word,
        tie('test').map((test) => `! ( ${test} )`),
        fc
          .tuple(tie('test'), fc.constantFrom('&&', '||'), tie('test'))
          .map(([a, sign, b]) => `( ${a} ) ${sign} ( ${b} )`),
      ),
    })).test;
    let line = 0;
    const text = fc.letrec<{ lines: string }>((tie) => ({
      lines: fc.oneof(
        { maxDepth: 3 },
        fc.constant('').map(() => `line${line++};`),
        fc
          .tuple(condition, tie('lines'), condition, tie('lines'), tie('lines'))
          .map(([a, one, b, two, three]) => `#if ${a}\n${one}\n#elif ${b}\n${two}\n#else\n${three}\n#endif`),
        fc.tuple(tie('lines'), tie('lines')).map((both) => both.join('\n')),
      ),
    })).lines;
    const value = fc.option(fc.nat(2), { nil: null });
    fc.assert(
      fc.property(text, fc.tuple(value, value, value, value), fc.subarray(names), (glsl, values, known) => {
        const all = new Map(names.map((name, i) => [name, values[i]!]));
        const some = new Map([...all].filter(([name]) => known.includes(name)));
        expect(withoutDeadBranches(withoutDeadBranches(glsl, some), all)).toBe(
          withoutDeadBranches(glsl, all),
        );
      }),
    );
  });
});

describe('texts', () => {
  it('keep their tokens without spaces', () => {
    const glsl =
      'float a( in float b ) {\n\treturn b - - 1.0 + +2.0; // why\n}\n#define C( x ) x\nvoid main() {\n a( 1. ); }';
    const tight = withoutSpaces(glsl);
    expect(tokens(tight)).toEqual(tokens(glsl));
    expect(tight).toContain('\n#define C( x ) x\n');
    expect(tight).toContain('\nvoid main() {\n');
    expect(tight.length).toBeLessThan(glsl.length - 15);
  });

  it('are answered for what is never there, and not where it is set', () => {
    expect(answered('if ( a.b.isSprite === true ) this.isSprite = true;')).toBe(
      'if ( false === true ) this.isSprite = true;',
    );
    expect(answered('!! material.envMap || material.envMapRotation')).toBe(
      '!! null || material.envMapRotation',
    );
  });

  it('lose members only by names that are there', () => {
    expect(() => withoutMembers('', ['gone'], { type: 'Program', body: [] }, 'a.js')).toThrow(
      'no gone in a.js',
    );
  });
});
