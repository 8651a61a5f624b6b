import { createHash } from 'node:crypto';
import { mkdirSync, readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { gzipSync } from 'node:zlib';
import react from '@vitejs/plugin-react';
import type { Plugin } from 'vite';
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

/** Chunks that the page itself imports, and those for signed-in viewers. A missing name here costs some bytes, nothing else. */
const IN_THE_PAGE =
  /\/(account|account_name|ahead|base|early|first_paint|jsx-runtime|language|level_latch|preload-helper|rolldown-runtime)-[\w-]{8}\.js$/;

/** Code shared by the page and lazy parts, in few chunks: a browser requests six files at a time, and the worker has to wait its
 *  turn. */
const SHARED_CHUNKS = [
  {
    // The early script needs this; the page's main script and most later parts need the next one as well.
    name: 'ahead',
    test: /spa\/src\/(auth\/(lane|token)|browser\/(storage|store)|model\/(bounds|bundle|files|lod_cache|manifest)|past\/past_source|relay\/(addresses|as_anyone|recording_address|relay)|stream\/clock)\.ts$/,
  },
  {
    name: 'base',
    test: /node_modules\/react\/|spa\/src\/(app\/(shell\/(media|page_keys)|state\/(settings|use_store)|status\/span_words|text\/language)|browser\/(drawn_lines|first_paint|late_part|retry)|model\/kinematics|twin\/(format|joints|liveness|names|plain_names|rotation|values|limits\/(level_latch|limits))|view\/camera\/framing)\.ts$/,
  },
  {
    // All of three.js except what only mesh readers need: a scene consists of this file and its own.
    name: 'three.core',
    test: /three\/src\/(?!loaders|animation|extras|math\/(?:I|i)nterpolant|objects\/(?:SkinnedMesh|Bone|Skeleton|Points|LineLoop)|lights\/(?:Ambient|Point|Spot)|materials\/(?:MeshPh|Points))/,
  },
  // The list has few texts, and needs no others.
  { name: 'list_words', test: /spa\/src\/app\/text\/list(_en)?\.ts$/ },
  // Texts of late parts: all of them need it, and the player of the past has loaded it by then.
  {
    name: 'more',
    test: /spa\/src\/(app\/(text\/(more|more_en|balance|balance\/balance_en|past|past\/past_en)|status\/(moment_words|past_words))|twin\/balance\/told\/margin_channel)\.ts$/,
  },
  { name: 'cells', test: /spa\/src\/app\/.*\/(cells\.ts|fault_words\.ts|FlagTerm\.tsx)$/ },
  {
    name: 'sensors',
    test: /spa\/src\/twin\/(plots\/(choice|trace)|sensors\/sensors)\.ts$/,
    includeDependenciesRecursively: false,
  },
  {
    // Shared by figures, balance and saving.
    name: 'root_pose',
    test: /spa\/src\/(model\/(articulated_body|root_pose|vectors)|overlays\/(colors|limb_across|picture_numbers)|twin\/(sensors\/imus|vectors|wrench_units))\.ts$/,
    includeDependenciesRecursively: false,
  },
  {
    // Reads a schema's mapping, as a whole: figures need most of it, balance the rest.
    name: 'mapping_parser',
    test: /wire\/typescript\/src\/(mapping_parser|stance)\.ts$/,
    includeDependenciesRecursively: false,
  },
  {
    // Computes, draws and describes balance, without its numbers, and without a selected joint's limits.
    name: 'balance',
    test: /spa\/src\/((overlays|model)\/balance\/(?!joint_arc)|view\/balance|app\/balance\/(balance_(part|watch)|Stood|spoken|stance)|twin\/balance\/(?!limit_margin|told\/(could|lacks|margin_channel)))/,
    includeDependenciesRecursively: false,
  },
];

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

/** A `.gz` beside every file that benefits, for hosts that serve such files, as the relay does. */
function packed(): Plugin {
  let folder = '';
  return {
    name: 'packed',
    apply: 'build',
    configResolved: (config) => {
      folder = path.resolve(config.root, config.build.outDir);
    },
    closeBundle: () => {
      for (const name of readdirSync(folder, { recursive: true, encoding: 'utf8' })) {
        if (!/\.(js|css|html|svg)$/.test(name)) continue;
        const file = path.join(folder, name);
        writeFileSync(`${file}.gz`, gzipSync(readFileSync(file), { level: 9 }));
      }
    },
  };
}

export default defineConfig({
  base: './', // one build for any path; the routes live in the hash
  plugins: [react(), contentPolicy(), earlyStart(), routesPage(), embedEntry(), packed()],
  build: {
    target: 'es2022',
    sourcemap: false,
    chunkSizeWarningLimit: 800,
    manifest: true,
    license: { fileName: 'licenses.json' }, // of the bundled packages, including their texts: they require that
    modulePreload: {
      polyfill: false, // a browser without it fetches a little later
      // A part's dependencies are fetched in parallel with it; those that the page has from the start are not listed again.
      resolveDependencies: (_, needed, { hostType }) =>
        hostType === 'js' ? needed.filter((file) => !IN_THE_PAGE.test(file)) : needed,
    },
    rolldownOptions: {
      input: { index: 'index.html', early: 'src/early.ts' },
      output: { codeSplitting: { groups: SHARED_CHUNKS } },
    },
  },
  worker: { format: 'es' },
  server: {
    proxy: { '/api': { target: process.env.POSECAST_RELAY ?? 'http://127.0.0.1:8080', ws: true } },
  },
  // these tests measure no time: on a busy machine, the default of five seconds would
  test: { include: ['src/**/*.test.ts', 'tests/**/*.test.ts'], environment: 'node', testTimeout: 120_000 },
});
