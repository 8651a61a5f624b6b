/** Computes the page's balance sentence for a sequence of frames, for tests in other languages: `node stance_course.mjs <
 *  COURSE`. */
import path from 'node:path';
import { text } from 'node:stream/consumers';
import { fileURLToPath } from 'node:url';
import { runnerImport } from 'vite';

const HERE = path.dirname(fileURLToPath(import.meta.url));
const { module } = await runnerImport(path.join(HERE, 'stance_course.ts'), {
  configFile: false,
  logLevel: 'error',
  root: path.resolve(HERE, '../..'),
});
process.stdout.write(JSON.stringify(module.readCourse(JSON.parse(await text(process.stdin)))));
