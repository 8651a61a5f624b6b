import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import type { Plugin } from 'vite';

const SHARED = '__DOM_INTERNALS_DO_NOT_USE_OR_WARN_USERS_THEY_CANNOT_UPGRADE';

/** Builds the page without the package `react-dom`, except for the object that its client (`react-dom/client`) uses: portals and
 *  preloads are not needed here. Only in the build: the dev server and the unit tests use all of it. */
export function leanReact(): Plugin {
  const folder = path.dirname(createRequire(import.meta.url).resolve('react-dom'));
  return {
    name: 'lean-react',
    apply: 'build',
    enforce: 'pre',
    resolveId(name, importer) {
      if (name === 'react-dom' && importer?.startsWith(folder) === false)
        this.error(`${importer}: lean_react leaves out what react-dom exports`);
      return null;
    },
    load(id) {
      if (id !== path.join(folder, 'index.js')) return null;
      const read = (file: string) => readFileSync(path.join(folder, `cjs/${file}.production.js`), 'utf8');
      return sharedAlone(read('react-dom'), read('react-dom-client'));
    },
  };
}

/** Keeps the parts of `react-dom` that its client uses. Throws if the client uses anything else. */
export function sharedAlone(dom: string, client: string): string {
  const [, internals] = /\bvar (Internals = \{.*?\n {2}\}),/s.exec(dom) ?? [];
  const uses = client.match(/\bReactDOM\b(?! = require\("react-dom"\)).*/g)?.map((use) => use.trim());
  if (internals === undefined || uses?.length !== 1 || !uses[0]!.startsWith(`ReactDOM.${SHARED}`))
    throw new Error(
      'lean_react/plugin.ts: react-dom or its client has changed: see what the client uses of it',
    );
  return [
    'const noop = () => {};',
    'const formatProdErrorMessage = (code) => "Minified React error #" + code;',
    `const ${internals};`,
    `exports.${SHARED} = Internals;`,
  ].join('\n');
}
