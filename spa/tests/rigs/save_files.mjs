/** Saves segments as the page does, for tests in other languages: `node save_files.mjs SEGMENTS_FOLDER INTO_FOLDER`. */
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { runnerImport } from 'vite';

const HERE = path.dirname(fileURLToPath(import.meta.url));
const [from, into] = process.argv.slice(2);
if (into === undefined) throw new Error('usage: save_files.mjs SEGMENTS_FOLDER INTO_FOLDER');
const { module } = await runnerImport(path.join(HERE, 'save_files.ts'), {
  configFile: false,
  logLevel: 'error',
  root: path.resolve(HERE, '../..'),
});
for (const file of await module.saveFiles(from, into)) process.stdout.write(`${file}\n`);
