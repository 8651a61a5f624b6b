/** Writes what a relay keeps of a robot as the files of a recording (`wire/SPEC.md`, §12), with the page or without it. */

import { cpSync, mkdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import {
  decodeSegment,
  encodeKeyPage,
  encodeRecording,
  keyPagePath,
  modelPath,
  type RecordedSegment,
  segmentPath,
} from '@posecast/wire';
import { zipSync } from 'fflate';
import { until } from './driver/until.ts';
import { REPO } from './stack.ts';

const PAGE_MS = 600_000;

export interface Told {
  readonly title?: string;
  readonly author?: string;
  readonly licence?: string;
  /** Each so many ms after the beginning. */
  readonly notes?: readonly { readonly afterMs: number; readonly text: string }[];
}

export interface Written {
  readonly folder: string;
  readonly fromMs: number;
  readonly toMs: number;
  readonly segments: readonly RecordedSegment[];
}

interface Entry {
  readonly take: string;
  readonly index: number;
  readonly run: string;
  readonly from_ms: number;
  readonly to_ms: number;
  readonly frames: number;
  readonly first_seq: number;
  readonly last_seq: number;
  readonly bytes: number;
  readonly schema: string | null;
  readonly model: string | null;
  readonly missing: number;
  readonly words: readonly { readonly at_ms: number; readonly word: 'online' | 'silent' | 'offline' }[];
  readonly events: readonly { readonly at_ms: number }[];
}

/** Records what a relay (its URL) keeps of a robot, as soon as that is long enough, into `folder`, without the page. */
export async function record(
  relay: string,
  folder: string,
  seconds: number,
  told: Told = {},
  robot = 'demo',
): Promise<Written> {
  const past = `${relay}/api/v1/robots/${robot}/past`;
  const json = async <T>(url: string): Promise<T> => (await fetch(url)).json() as Promise<T>;
  const bytesOf = async (url: string) => new Uint8Array(await (await fetch(url)).arrayBuffer());
  const summary = await until(
    `${seconds} s of past`,
    async () => {
      const found = await json<{ view: string; from_ms: number; to_ms: number }>(past);
      return found.to_ms - found.from_ms >= 1000 * seconds ? found : null;
    },
    1000 * seconds + 60_000,
  );
  const { view } = summary;
  const entries: Entry[] = [];
  for (let at = Math.floor(summary.from_ms / PAGE_MS); at * PAGE_MS <= summary.to_ms; at += 1) {
    const minute = `${new Date(at * PAGE_MS).toISOString().slice(0, 16)}Z`;
    entries.push(...(await json<{ segments: Entry[] }>(`${past}/${view}/${minute}`)).segments);
  }
  entries.sort(
    (a, b) => a.from_ms - b.from_ms || (a.take < b.take ? -1 : a.take > b.take ? 1 : a.index - b.index),
  );
  const put = (name: string, bytes: Uint8Array | string) => {
    mkdirSync(path.dirname(path.join(folder, name)), { recursive: true });
    writeFileSync(path.join(folder, name), bytes);
  };
  const schemas = new Map<string, string>();
  const models = new Set<string>();
  const pages = new Map<number, Uint8Array[]>();
  const segments: RecordedSegment[] = [];
  for (const entry of entries) {
    const { take, index, schema, model } = entry;
    const bytes = await bytesOf(`${past}/${view}/${take}/${index}`);
    put(segmentPath({ take, index }), bytes);
    const page = Math.floor(entry.from_ms / PAGE_MS) * PAGE_MS;
    if (entry.frames > 0) pages.set(page, [...(pages.get(page) ?? []), bytes]);
    if (schema !== null && !schemas.has(schema))
      schemas.set(schema, new TextDecoder().decode(await bytesOf(`${past}/${view}/schema/${schema}`)));
    if (model !== null) models.add(model);
    segments.push({
      ...{ take, index, runId: entry.run, fromMs: entry.from_ms, toMs: entry.to_ms, frames: entry.frames },
      ...{ firstSeq: entry.first_seq, lastSeq: entry.last_seq, bytes: bytes.length, schema, model },
      missing: entry.missing,
      words: entry.words.map(({ at_ms: atMs, word }) => ({ atMs, word })),
      events: entry.events.map(({ at_ms: atMs, ...event }) => ({ atMs, event })),
    });
  }
  for (const [fromMs, some] of pages) put(keyPagePath(fromMs), encodeKeyPage({ robot, view, fromMs }, some));
  for (const model of models) {
    const at = `${relay}/api/v1/robots/${robot}/model/${model}/`;
    const manifest = await bytesOf(`${at}manifest.json`);
    put(modelPath(model, 'manifest.json'), manifest);
    for (const name of namesIn(JSON.parse(new TextDecoder().decode(manifest))))
      put(modelPath(model, name), await bytesOf(at + name));
  }
  const fromMs = segments[0]!.fromMs;
  const toMs = Math.max(...segments.map((each) => each.toMs));
  const { title = null, author = null, licence = null } = told;
  const notes = (told.notes ?? []).map(({ afterMs, text }) => ({
    atMs: Math.min(toMs, fromMs + afterMs),
    text,
  }));
  put(
    'recording.json',
    encodeRecording({
      ...{ robot, view, title, author, licence, fromMs, toMs, notes },
      ...{ schemas, models: [...models], segments },
    }),
  );
  return { folder, fromMs, toMs, segments };
}

/** The paths of all files that a manifest of either version names. */
function namesIn(value: unknown): string[] {
  if (typeof value !== 'object' || value === null) return [];
  const { path: name } = value as { path?: unknown };
  const inside = Object.values(value).flatMap(namesIn);
  return typeof name === 'string' ? [...new Set([name, ...inside])] : [...new Set(inside)];
}

/** Puts the page beside a recording, as an export has it. */
export function addPage(folder: string): void {
  cpSync(path.join(REPO, 'spa/dist'), folder, { recursive: true });
  for (const [name, index] of [
    ['index.html', 'recording.json'],
    ['embed/index.html', '../recording.json'],
  ] as const) {
    const page = readFileSync(path.join(folder, name), 'utf8')
      .replace(/\s*<script type="module" async [^>]*><\/script>/, '')
      .replace('<head>', `<head>\n    <meta name="posecast-recording" content="${index}" />`);
    writeFileSync(path.join(folder, name), page);
    rmSync(path.join(folder, `${name}.gz`), { force: true }); // of the page as it was
  }
}

/** A recording as one `.posecast` file; every second entry is only stored. */
export function packed(files: ReadonlyMap<string, Uint8Array>): Uint8Array {
  return zipSync(
    Object.fromEntries([...files].map(([name, bytes], i) => [name, [bytes, { level: i % 2 === 0 ? 6 : 0 }]])),
  );
}

/** Whether a segment's file holds what its name says. */
export function isWhole(bytes: Uint8Array, { take, index }: RecordedSegment): boolean {
  const { start } = decodeSegment(bytes);
  return start.take === take && start.index === index;
}
