import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { saveSpan } from '../../src/past/save/save.ts';
import { bytesOf, SavedStage } from './saved_stage.ts';

/** Saves, as the page does, all segments of a folder (`*.pcs`, with `schema.json`) in each format. Returns the paths of the files, which lie
 *  in the folder `into`. */
export async function saveFiles({ from, into }: { from: string; into: string }): Promise<string[]> {
  const segments = readdirSync(from).filter((name) => name.endsWith('.pcs'));
  const schema = readFileSync(path.join(from, 'schema.json'), 'utf8');
  const stage = new SavedStage(
    segments.map((name) => Uint8Array.from(readFileSync(path.join(from, name)))),
    [schema],
  );
  const span = { fromMs: stage.refs[0]!.fromMs, toMs: stage.refs.at(-1)!.toMs };
  const paths: string[] = [];
  for (const format of ['csv', 'posecast'] as const) {
    const { blob } = await saveSpan(format, span, stage);
    const file = path.join(into, `page.${format}`);
    writeFileSync(file, await bytesOf(blob));
    paths.push(file);
  }
  return paths;
}
