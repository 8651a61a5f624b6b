/** The cost of computing a robot's balance on the page: `node spa/benches/balance.mjs`. */
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { runnerImport } from 'vite';

const HERE = path.dirname(fileURLToPath(import.meta.url));
const { module } = await runnerImport(path.join(HERE, 'balance.ts'), {
  configFile: false,
  logLevel: 'error',
  root: path.dirname(HERE),
});
for (const line of module.measureBalance()) process.stdout.write(`${line}\n`);
