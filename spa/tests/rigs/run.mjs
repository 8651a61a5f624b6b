/** Runs a function of one of the modules here for tests in other languages: `node run.mjs MODULE FUNCTION < INPUT.json`. Prints as
 *  JSON what it returns for the input. */
import path from 'node:path';
import { text } from 'node:stream/consumers';
import { runnerImport } from 'vite';

const [name, run] = process.argv.slice(2);
const { module } = await runnerImport(path.join(import.meta.dirname, name), {
  configFile: false,
  logLevel: 'error',
  root: path.resolve(import.meta.dirname, '../..'),
});
process.stdout.write(JSON.stringify(await module[run](JSON.parse(await text(process.stdin)))));
