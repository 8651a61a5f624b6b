import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { gzipSync } from 'node:zlib';
import react from '@vitejs/plugin-react';
import type { Plugin } from 'vite';
import { defineConfig } from 'vitest/config';

/**
 * What the built page may load. It stands in the page itself, so that it holds on any host, also one that sets no
 * headers. The dev server's reload script is inline, hence only in the build.
 */
const CONTENT_POLICY = [
  "default-src 'self'",
  "script-src 'self' 'wasm-unsafe-eval'",
  "img-src 'self' data: blob:",
  "connect-src 'self' blob: data:",
  "worker-src 'self' blob:",
  "object-src 'none'",
  "base-uri 'none'",
  "form-action 'none'",
].join('; ');

function contentPolicy(): Plugin {
  return {
    name: 'content-policy',
    apply: 'build',
    transformIndexHtml: () => [
      {
        tag: 'meta',
        attrs: { 'http-equiv': 'Content-Security-Policy', content: CONTENT_POLICY },
        injectTo: 'head-prepend',
      },
    ],
  };
}

/** urdf-loader imports its mesh loaders whether they are used or not. The scene reads meshes itself, Collada only when
 *  there is some: without this its 20 kB would come with every 3D view. */
function withoutUnusedLoaders(): Plugin {
  const unused = /^three\/examples\/jsm\/loaders\/(STLLoader|ColladaLoader)\.js$/;
  return {
    name: 'without-unused-loaders',
    enforce: 'pre',
    resolveId: (id, importer) =>
      unused.test(id) && importer?.includes('urdf-loader') ? `\0unused:${id}` : undefined,
    load: (id) =>
      id.startsWith('\0unused:') ? 'export class STLLoader {}\nexport class ColladaLoader {}' : undefined,
  };
}

/** A `.gz` beside every file that shrinks, for hosts that serve what lies there, as the relay does. */
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
  plugins: [react(), contentPolicy(), withoutUnusedLoaders(), packed()],
  build: { target: 'es2022', sourcemap: false, chunkSizeWarningLimit: 800, manifest: true },
  worker: { format: 'es' },
  server: {
    proxy: { '/api': { target: process.env.POSECAST_RELAY ?? 'http://127.0.0.1:8080', ws: true } },
  },
  test: { include: ['src/**/*.test.ts', 'tests/**/*.test.ts'], environment: 'node' },
});
