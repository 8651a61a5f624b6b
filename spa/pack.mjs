/** Compresses the files of a folder in advance, for hosts that serve such files, as the relay does: NAME.br and NAME.gz beside NAME.
 *
 *      node spa/pack.mjs FOLDER
 */
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { promisify } from 'node:util';
import { brotliCompress, gzip } from 'node:zlib';

/** Pictures and fonts are compressed already. */
const WORTH_IT = /\.(js|css|html|json|svg)$/;

const [folder] = process.argv.slice(2);
const names = readdirSync(folder, { recursive: true, encoding: 'utf8' }).filter((name) =>
  WORTH_IT.test(name),
);
await Promise.all(
  names.map(async (name) => {
    const file = path.join(folder, name);
    const bytes = readFileSync(file);
    writeFileSync(`${file}.br`, await promisify(brotliCompress)(bytes)); // at its best level, which is its default
    writeFileSync(`${file}.gz`, await promisify(gzip)(bytes, { level: 9 }));
  }),
);
