/** Recordings exported by `posecast-relay past export` from what a relay keeps. */

import { execFile } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { promisify } from 'node:util';
import { until } from './driver/until.ts';
import { REPO, type Relay, type Stack } from './stack.ts';

const run = promisify(execFile);

export interface Told {
  readonly title?: string;
  readonly author?: string;
  readonly licence?: string;
  /** Each this many seconds after the start, less than a minute. */
  readonly notes?: readonly (readonly [atS: number, text: string])[];
}

/** The `recording.json` of an export, as far as tests need it. */
export interface Exported {
  /** The folder, or the file. */
  readonly at: string;
  readonly fromMs: number;
  readonly toMs: number;
  /** The paths of the segments, in order. */
  readonly segments: readonly string[];
}

/** Exports a relay's past of a robot once it is this long: to a folder, or to a file if `name` ends in `.posecast`. */
export async function exportPast(
  stack: Stack,
  relay: Relay,
  seconds: number,
  told: Told = {},
  name = 'lecture',
): Promise<Exported> {
  const folder = stack.folder();
  await until(
    `${seconds} s of past`,
    async () => {
      const { from_ms, to_ms } = (await relay.json('/api/v1/robots/demo/past')) as Record<string, number>;
      return to_ms! - from_ms! >= 1000 * seconds;
    },
    1000 * seconds + 60_000,
  );
  const at = path.join(folder, name);
  const notes = path.join(folder, 'notes.toml');
  const two = (count: number) => String(count).padStart(2, '0');
  writeFileSync(
    notes,
    (told.notes ?? [])
      .map(([atS, text]) => `[[note]]\nat = "00:00:${two(atS)}"\ntext = ${JSON.stringify(text)}\n`)
      .join(''),
  );
  const { title, author, licence } = told;
  const named = Object.entries({ title, author, licence }).flatMap(([flag, text]) =>
    text === undefined ? [] : [`--${flag}`, text],
  );
  const hour = (byMs: number) => new Date(Date.now() + byMs).toISOString();
  await run(path.join(REPO, '.venv/bin/posecast-relay'), [
    ...['past', 'export', '--robot', 'demo', '--relay', relay.url, '-o', at],
    ...['--from', hour(-3_600_000), '--to', hour(0), ...named],
    ...(told.notes === undefined ? [] : ['--notes', notes]),
    ...(name.endsWith('.posecast') ? [] : ['--page', path.join(REPO, 'spa/dist')]),
  ]);
  if (name.endsWith('.posecast')) return { at, fromMs: 0, toMs: 0, segments: [] };
  const doc = JSON.parse(readFileSync(path.join(at, 'recording.json'), 'utf8')) as {
    from_ms: number;
    to_ms: number;
    takes: { take: string }[];
    segments: number[][];
  };
  const segments = doc.segments.map(([take, index]) => `segments/${doc.takes[take!]!.take}/${index}.segment`);
  return { at, fromMs: doc.from_ms, toMs: doc.to_ms, segments };
}
