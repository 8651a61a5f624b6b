import { createHash } from 'node:crypto';
import { mkdirSync, readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import react from '@vitejs/plugin-react';
import type { Plugin, Rolldown } from 'vite';
import { defineConfig } from 'vitest/config';

const RELAYS = 'https: wss: http://localhost:* ws://localhost:* http://127.0.0.1:* ws://127.0.0.1:*';
/**
 * What the built page may load. It is in the page itself, so that it applies on any host, even one that sets no headers. The dev
 * server's reload script is inline, so this is only in the build.
 */
const contentPolicyOf = (page: string) =>
  [
    "default-src 'self'",
    `script-src 'self' 'wasm-unsafe-eval' ${inlineScriptHash(page)}`,
    // A relay may be elsewhere: `relay/relay.ts` narrows these to the one it reads as soon as it is known.
    `img-src 'self' data: blob: ${RELAYS}`,
    `connect-src 'self' blob: data: ${RELAYS}`,
    "worker-src 'self' blob:",
    "object-src 'none'",
    "base-uri 'none'",
    "form-action 'none'",
  ].join('; ');

const EARLY = path.resolve(import.meta.dirname, 'src/early.ts');

/** The parts of a robot's first picture, one of the last two. What several of them need is a file of its own. */
const FIRST = {
  numbers: path.resolve(import.meta.dirname, 'src/app/numbers/Panel.tsx'),
  three: path.resolve(import.meta.dirname, 'src/scene/three/index.ts'),
  light: path.resolve(import.meta.dirname, 'src/scene/canvas2d/view.ts'),
};

/** Other parts of the page that are loaded together are one file. */
const TOGETHER: readonly (readonly [name: string, files: RegExp])[] = [
  ['segments', /wire\/typescript\/src\/(segment|recording|messages|decoder|frame|checked|schema_parser)/],
  ['faults', /src\/app\/(state\/own_alarms|words)/],
  ['moments', /src\/app\/past\/(jump|save\/(?!Outcome))/],
  ['past', /src\/(app\/past|past\/(?!save|recording))/],
  ['recording', /src\/(app\/pages\/recording|past\/recording)/],
  ['balance', /src\/(app\/balance\/(?!BalanceParts)|scene\/signs\/(balance_|footprints|joint_arc))/],
  ['settings', /src\/app\/settings\/(?!LimitSettings)/],
  ['share', /src\/app\/(present|share\/(?!view_address))|node_modules\/qr\//],
  ['plots', /src\/app\/(numbers\/plots|robot\/SelfPlots)|node_modules\/uplot\//],
  ['dialogs', /src\/app\/shell\/(Dialog|Command|SettingChoice|styles\/(dialog|choices|command))/],
  ['signs', /src\/app\/shell\/styles\/signs/],
  ['body', /src\/app\/(robot|numbers|explain|words|shell|state|share|balance|settings)\b.*\.(ts|tsx|css)$/],
];

/** The code that the page starts with, in two files: a browser requests six at a time, and the stream's worker has to wait its turn.
 *  The early script is apart, because it runs before the rest has loaded. three.js is apart from the scene that alone needs it,
 *  because it changes less often. All other code is split by what loads it. */
const CHUNKS: Rolldown.CodeSplittingGroup[] = [
  { name: 'threejs', test: /node_modules\/three\/build\// },
  {
    name: (id, graph) => (importsOf(EARLY, graph).has(id) ? 'early' : 'page'),
    tags: ['$initial'],
  },
  {
    name: (id, graph) => {
      // all that imports anything of this package imports its index, which imports all of it
      if (id.includes('/wire/typescript/')) return null;
      const needed = Object.entries(FIRST).filter(([, file]) => importsOf(file, graph).has(id));
      return needed.map(([name]) => name).join('_') || null;
    },
  },
  { name: (id) => TOGETHER.find(([, files]) => files.test(id))?.[0] ?? null },
  { name: 'twin', test: /src\/(twin|browser|model|scene\/(signs|figure|camera))\// },
];

/** A module and all that it imports at once. */
function importsOf(
  id: string,
  graph: Rolldown.ChunkingContext,
  found = new Set<string>(),
): ReadonlySet<string> {
  if (found.has(id)) return found;
  found.add(id);
  for (const imported of graph.getModuleInfo(id)?.importedIds ?? []) importsOf(imported, graph, found);
  return found;
}

/** The source expression for the page's only inline script. */
function inlineScriptHash(page: string): string {
  const script = /<script>(.*?)<\/script>/s.exec(page)?.[1];
  if (script === undefined) throw new Error('no inline script');
  return `'sha256-${createHash('sha256').update(script).digest('base64')}'`;
}

function contentPolicy(): Plugin {
  return {
    name: 'content-policy',
    apply: 'build',
    transformIndexHtml: (page) => [
      {
        tag: 'meta',
        attrs: { 'http-equiv': 'Content-Security-Policy', content: contentPolicyOf(page) },
        injectTo: 'head-prepend',
      },
    ],
  };
}

/** `early.ts` runs as soon as it has loaded, whatever else is still loading; Vite would merge it into the main script. */
function earlyStart(): Plugin {
  return {
    name: 'early-start',
    apply: 'build',
    transformIndexHtml: {
      order: 'post',
      handler: (html, { bundle }) => {
        const early = Object.values(bundle ?? {}).find(
          (chunk) => chunk.type === 'chunk' && chunk.name === 'early',
        );
        if (early === undefined) throw new Error('no early chunk');
        const src = `./${early.fileName}`;
        const rest = html.replace(new RegExp(`\\s*<link rel="modulepreload"[^>]*href="${src}"[^>]*>`), '');
        // Before all others: a browser fetches in this order, and it is small.
        return rest.replace('<script ', `<script type="module" async src="${src}"></script>\n    <script `);
      },
    },
  };
}

/** The documentation of the relay's routes, as in FastAPI, but served from here and not from a CDN. */
function routesPage(): Plugin {
  const require = createRequire(import.meta.url);
  return {
    name: 'routes-page',
    apply: 'build',
    generateBundle() {
      for (const file of ['swagger-ui.css', 'swagger-ui-bundle.js', 'LICENSE', 'NOTICE']) {
        const source = readFileSync(require.resolve(`swagger-ui-dist/${file}`));
        this.emitFile({ type: 'asset', fileName: `docs/${file}`, source });
      }
    },
  };
}

/** `embed/index.html`, the entry for an iframe: the same page, one folder deeper (as its root element says), and without the
 *  early start, because it requests nothing before it is on screen. As a separate entry of the bundler it would split the common
 *  code into a dozen files that a phone fetches one by one. */
function embedEntry(): Plugin {
  let folder = '';
  return {
    name: 'embed-entry',
    apply: 'build',
    configResolved: (config) => {
      folder = path.resolve(config.root, config.build.outDir);
    },
    writeBundle: () => {
      const page = readFileSync(path.join(folder, 'index.html'), 'utf8');
      const deeper = page
        .replace(
          /<script type="module" async src=("[^"]*")><\/script>/, // not run first, but not waited for either
          '<link rel="modulepreload" crossorigin href=$1>',
        )
        .replace(/(href|src)="\.\//g, '$1="../')
        .replace('<html ', '<html data-page="embed" data-home="../" ');
      mkdirSync(path.join(folder, 'embed'), { recursive: true });
      writeFileSync(path.join(folder, 'embed/index.html'), deeper);
    },
  };
}

const TESTS = readdirSync(path.join(import.meta.dirname, 'tests'), { recursive: true, encoding: 'utf8' })
  .filter((file) => file.endsWith('.test.ts'))
  .map((file) => `tests/${file}`);

/** Whether a test file needs a process of its own: it needs a document, replaces modules, or changes the state of the page or of
 *  the choice of a relay, which is in their modules. A process costs a quarter of a second, so all others share theirs, and undo
 *  what they replace. */
function isAlone(file: string): boolean {
  const text = readFileSync(path.join(import.meta.dirname, file), 'utf8');
  return /^tests\/(app|relay)\//.test(file) || /happy-dom|\bvi\.(mock|doMock|resetModules)\b/.test(text);
}

export default defineConfig({
  base: './', // one build for any path; the routes live in the hash
  plugins: [react(), contentPolicy(), earlyStart(), routesPage(), embedEntry()],
  build: {
    target: 'es2022',
    sourcemap: false,
    chunkSizeWarningLimit: 800,
    manifest: true,
    license: { fileName: 'licenses.json' }, // of the bundled packages, including their texts: they require that
    modulePreload: { polyfill: false }, // a browser without it fetches a little later
    rolldownOptions: {
      checks: { pluginTimings: false }, // how long plugins took is nothing to act on
      input: { index: 'index.html', early: 'src/early.ts' },
      output: { codeSplitting: { includeDependenciesRecursively: false, groups: CHUNKS } },
    },
  },
  worker: { format: 'es' },
  server: {
    proxy: { '/api': { target: process.env.POSECAST_RELAY ?? 'http://127.0.0.1:8080', ws: true } },
  },
  test: {
    environment: 'node',
    testTimeout: 120_000, // these tests measure no time: on a busy machine, the default of five seconds would
    maxWorkers: '100%',
    setupFiles: [path.resolve(import.meta.dirname, 'tests/rigs/patience.ts')],
    projects: [
      { extends: true, test: { name: 'alone', include: TESTS.filter(isAlone) } },
      {
        extends: true,
        test: { name: 'together', include: TESTS.filter((file) => !isAlone(file)), isolate: false },
      },
    ],
  },
});
