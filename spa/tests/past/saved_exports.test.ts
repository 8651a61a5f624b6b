import { readFileSync } from 'node:fs';
import { expect, it } from 'vitest';
import { saveSpan } from '../../src/past/save/save.ts';
import { bytesOf, SavedStage } from '../rigs/saved_stage.ts';

interface Case {
  readonly name: string;
  readonly from_ms: number;
  readonly to_ms: number;
  readonly schemas: readonly string[];
  /** Manifests. */
  readonly models: readonly string[];
  readonly segments: readonly string[];
  readonly csv: string;
}

const VECTORS = new URL('../../../wire/vectors/exports.json', import.meta.url);
const { cases } = JSON.parse(readFileSync(VECTORS, 'utf8')) as { cases: readonly Case[] };

const stageOf = ({ segments, schemas, models }: Case) =>
  new SavedStage(
    segments.map((digits) => Uint8Array.from(Buffer.from(digits, 'hex'))),
    schemas,
    models,
  );
const spanOf = ({ from_ms, to_ms }: Case) => ({ fromMs: from_ms, toMs: to_ms });

it.each(cases)('$name: the page saves the CSV that the command exports, and balance', async (each) => {
  const { blob, name } = await saveSpan('csv', spanOf(each), stageOf(each));
  const bytes = await bytesOf(blob);
  expect([...bytes.subarray(0, 3)]).toEqual([0xef, 0xbb, 0xbf]);
  expect(new TextDecoder().decode(bytes)).toBe(each.csv);
  expect(name).toMatch(/^demo_2026-11-2\d_\d\d-\d\d-\d\d\.csv$/);
});
