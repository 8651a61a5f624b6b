/**
 * Bundles serve.ts, and with it the page's readers, into one file for Node: `node build.mjs FILE`.
 *
 * Counters are woven into our own sources, one for each way the code can take, so that libFuzzer is led by the coverage
 * of TypeScript as it is by Python's. (jazzer.js would do it too, but is built natively; fast-check has no coverage.)
 */
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { build, parseSync } from 'vite';

const HERE = path.dirname(fileURLToPath(import.meta.url));
const OURS = /\/(spa|wire\/typescript)\/src\/.*\.ts$/;
const COUNTERS = 65_536; // as many as their numbers in two bytes can name

let counters = 0;

/** The same source; what is `at` a place is put in there. */
function weave(code, file) {
  const { program, errors } = parseSync(file, code);
  if (errors.length > 0) throw new Error(`${file}: ${errors[0].message}`);
  const inserts = [];
  const tick = () => {
    if (counters === COUNTERS) throw new Error('more ways than counters');
    return `__hits[${counters++}]=1`;
  };
  const statement = (node) => {
    if (node.type === 'BlockStatement') return; // has a counter of its own
    inserts.push([node.start, `{${tick()};`], [node.end, '}']);
  };
  const expression = (node) => inserts.push([node.start, `(${tick()},`], [node.end, ')']);
  const visit = (node) => {
    if (node.type === 'BlockStatement') inserts.push([node.start + 1, `${tick()};`]);
    else if (node.type === 'SwitchCase' && node.consequent.length > 0)
      inserts.push([node.consequent[0].start, `${tick()};`]);
    else if (node.type === 'IfStatement') {
      statement(node.consequent);
      if (node.alternate) statement(node.alternate);
    } else if (/^(For|ForIn|ForOf|While|DoWhile)Statement$/.test(node.type)) statement(node.body);
    else if (node.type === 'ConditionalExpression') {
      expression(node.consequent);
      expression(node.alternate);
    } else if (node.type === 'LogicalExpression') expression(node.right);
    else if (node.type === 'ArrowFunctionExpression' && node.body.type !== 'BlockStatement')
      expression(node.body);
    for (const child of Object.values(node)) {
      for (const one of Array.isArray(child) ? child : [child]) {
        if (typeof one?.type === 'string') visit(one);
      }
    }
  };
  visit(program);
  // An opening belongs after what was opened there before it, an ending before what ends there after it.
  const order = inserts.map(([at, text], n) => ({ at, text, n: text === '}' || text === ')' ? -n : n }));
  order.sort((a, b) => a.at - b.at || a.n - b.n);
  let woven = '';
  let from = 0;
  for (const { at, text } of order) {
    woven += code.slice(from, at) + text;
    from = at;
  }
  return woven + code.slice(from);
}

const [out] = process.argv.slice(2);
if (out === undefined) throw new Error('usage: build.mjs FILE');
await build({
  root: HERE,
  configFile: false,
  logLevel: 'error',
  ssr: { noExternal: true },
  plugins: [
    {
      name: 'counters',
      enforce: 'pre',
      transform: (code, id) => (OURS.test(id) ? { code: weave(code, id), map: null } : undefined),
    },
  ],
  build: {
    ssr: path.join(HERE, 'serve.ts'),
    outDir: path.dirname(out),
    emptyOutDir: false,
    minify: false,
    rolldownOptions: {
      output: {
        entryFileNames: path.basename(out),
        codeSplitting: false,
        banner: `globalThis.__hits = new Uint8Array(${COUNTERS});`,
      },
    },
  },
});
