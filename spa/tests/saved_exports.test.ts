import { readFileSync } from 'node:fs';
import { type IReadable, McapIndexedReader, McapStreamReader } from '@mcap/core';
import { expect, it } from 'vitest';
import { saveSpan } from '../src/past/save/save.ts';
import { readLz4Frame } from './lz4_reader.ts';
import { type RosValue, readRosMessage } from './ros_message.ts';
import { bytesOf, SavedStage } from './saved_stage.ts';

interface Case {
  readonly name: string;
  readonly from_ms: number;
  readonly to_ms: number;
  readonly schemas: readonly string[];
  /** Manifests. */
  readonly models: readonly string[];
  readonly segments: readonly string[];
  readonly csv: string;
  /** NaN is null; a rotation is the quaternion with w ≥ 0. */
  readonly messages: readonly (readonly [topic: string, type: string, atUs: number, content: RosValue])[];
}

const VECTORS = new URL('../../wire/vectors/exports.json', import.meta.url);
const { cases } = JSON.parse(readFileSync(VECTORS, 'utf8')) as { cases: readonly Case[] };

/** The vectors have six decimals. */
const NEAR = 2e-6;

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

it.each(cases)('$name: the page saves the messages that the command exports', async (each) => {
  const { blob } = await saveSpan('mcap', spanOf(each), stageOf(each));
  const found = readMcap(await bytesOf(blob));
  const differences = found.flatMap(([topic, type, atUs, content], i) => {
    const [wantedTopic, wantedType, wantedUs, wanted] = each.messages[i] ?? [];
    const said = `${i}: ${topic} ${type} ${atUs}`;
    if (said !== `${i}: ${wantedTopic} ${wantedType} ${wantedUs}`) return [said];
    return differencesOf(content, wanted!, said);
  });
  expect(differences).toEqual([]);
  expect(found.length).toBe(each.messages.length);
});

it('an MCAP file has an index, statistics and a profile by which rosbag2 reads it', async () => {
  const [each] = cases as readonly [Case];
  const { blob } = await saveSpan('mcap', spanOf(each), stageOf(each));
  const bytes = await bytesOf(blob);
  const readable: IReadable = {
    size: async () => BigInt(bytes.length),
    read: async (at, size) => bytes.slice(Number(at), Number(at + size)),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: { lz4: readLz4Frame } });
  expect(reader.header).toMatchObject({ profile: 'ros2', library: 'posecast' });
  expect(reader.statistics?.messageCount).toBe(BigInt(each.messages.length));
  expect(reader.chunkIndexes.length).toBeGreaterThan(0);
  let count = 0;
  for await (const message of reader.readMessages()) {
    expect(message.logTime).toBe(message.publishTime);
    count += 1;
  }
  expect(count).toBe(each.messages.length);
});

function readMcap(bytes: Uint8Array): [topic: string, type: string, atUs: number, content: RosValue][] {
  const reader = new McapStreamReader({ decompressHandlers: { lz4: readLz4Frame } });
  reader.append(bytes);
  const schemas = new Map<number, { name: string; text: string }>();
  const channels = new Map<number, { topic: string; schemaId: number }>();
  const found: [string, string, number, RosValue][] = [];
  for (let record = reader.nextRecord(); record !== undefined; record = reader.nextRecord()) {
    if (record.type === 'Schema') {
      expect(record.encoding).toBe('ros2msg');
      schemas.set(record.id, { name: record.name, text: new TextDecoder().decode(record.data) });
    } else if (record.type === 'Channel') {
      expect(record.messageEncoding).toBe('cdr');
      channels.set(record.id, record);
    } else if (record.type === 'Message') {
      const { topic, schemaId } = channels.get(record.channelId)!;
      const { name, text } = schemas.get(schemaId)!;
      found.push([topic, name, Number(record.logTime / 1000n), readRosMessage(text, record.data)]);
    }
  }
  expect(reader.done()).toBe(true);
  return found;
}

/** The differences between two contents beyond rounding. */
function differencesOf(found: RosValue, wanted: RosValue, where: string): string[] {
  if (typeof found === 'number' && typeof wanted === 'number')
    return Math.abs(found - wanted) < NEAR ? [] : [`${where}: ${found}, not ${wanted}`];
  if (typeof found !== 'object' || found === null || typeof wanted !== 'object' || wanted === null)
    return found === wanted ? [] : [`${where}: ${found}, not ${wanted}`];
  const [ours, theirs] = [membersOf(found), membersOf(wanted)];
  if (ours.size !== theirs.size) return [`${where}: ${[...ours.keys()]}, not ${[...theirs.keys()]}`];
  return [...ours].flatMap(([name, value]) => differencesOf(value, theirs.get(name)!, `${where}.${name}`));
}

/** Without constants; a rotation with w ≥ 0. */
function membersOf(value: object): Map<string, RosValue> {
  const members = Object.entries(value as Record<string, RosValue>).filter(
    ([name]) => !/^[A-Z]+$/.test(name),
  );
  const isTurned = members.length === 4 && ((value as { w?: number }).w ?? 0) < 0;
  return new Map(
    members.map(([name, each]) => [name, isTurned && typeof each === 'number' ? -each : each] as const),
  );
}
