import { decodeKeyPage, decodeRecording, encodeSegment, eventOf, parseSchema } from '@posecast/wire';
import { unzipSync } from 'fflate';
import { describe, expect, it } from 'vitest';
import { CsvTable, cellOf, decimalsOf } from '../../src/past/save/csv_file.ts';
import { fileName, measureSpan, saveSpan } from '../../src/past/save/save.ts';
import { BlobParts, type SaveFormat } from '../../src/past/save/saved_span.ts';
import { FROM_MS, fault, recorded, SCHEMA, type Sending, sent } from '../rigs/past_recordings.ts';
import { bytesOf, nameOf, SavedStage, sha256Of } from '../rigs/saved_stage.ts';

const FORMATS = ['csv', 'posecast'] as const satisfies readonly SaveFormat[];
const MANIFEST = JSON.stringify({
  ...{ v: 2, robot: 'r', levels: [], links: ['trunk', 'arm'], visuals: [] },
  joints: [{ name: 'J0', parent: 0, child: 1, type: 'revolute', axis: [0, 0, 1] }],
  files: [
    { path: 'lod0.glb', size: 11, sha256: 'aa'.repeat(32) },
    { path: 'parts/a b.bin', size: 16, sha256: 'bb'.repeat(32) },
  ],
});
const MODEL = sha256Of(MANIFEST);

/** A robot of two joints, with ten frames a second. */
function stage(
  count: number,
  sending: Sending = {},
  happened: Parameters<typeof recorded>[1] = {},
): SavedStage {
  const segments = recorded(sent(count, sending), { schemaSha: sha256Of(SCHEMA.text), ...happened });
  const withModel = segments.map((each) => ({ ...each, start: { ...each.start, model: MODEL } }));
  return new SavedStage(withModel.map(encodeSegment), [SCHEMA.text], [MANIFEST]);
}

const all = (rig: SavedStage) => ({ fromMs: rig.refs[0]!.fromMs, toMs: rig.refs.at(-1)!.toMs });
const csvLines = async (blob: Blob) =>
  new TextDecoder()
    .decode(await bytesOf(blob))
    .split('\r\n')
    .slice(0, -1);

describe('a table', () => {
  it('says numbers with the digits of their step', () => {
    expect([0.001, 0.0005, 0.25, 1, 20, 2.5, 1e-9, 1 / 3, 0.30000000000000004].map(decimalsOf)).toEqual([
      3, 4, 2, 0, 0, 1, 9, 6, 6,
    ]);
  });

  it('quotes what a table must, and what a spreadsheet would calculate', () => {
    const cells = ['plain', 'a,b', 'say "no"', 'two\nlines', '=1+1', '+1', '-1', '@x', '=a,b'].map(cellOf);
    expect(cells).toEqual([
      ...['plain', '"a,b"', '"say ""no"""', '"two\nlines"'],
      ...["'=1+1", "'+1", "'-1", "'@x", `"'=a,b"`],
    ]);
  });

  it('has no formula behind any sign at which a spreadsheet may split lines', () => {
    for (const separator of ',;|\t\r\n :^~!#&/\\$%*\'"\x1f\xa0\u3000，；؛、｜')
      for (const sign of '=+-@＝＋－＠') {
        expect(cellOf(`x${separator}${sign}1`)).toContain(`${separator}'${sign}1`);
        expect(cellOf(`x${separator}"${sign}1,"`)).toContain(`"'${sign}1`);
      }
    const names = ['left-knee', '무릎-왼쪽', 'torso.-x', 'ratio [-]', 'I<=0', '--x', 'a;=-1', "'=1"];
    const kept = names.slice(0, 5);
    expect(names.map(cellOf)).toEqual([...kept, "'--x", "a;'=-1", "''=1"]);
  });

  it('has a cell without a reading empty, and tells flags by name', () => {
    const labels = { joint: ['=J', 'K'] };
    const fields = [
      { name: 'pos', labels: 'joint', unit: 'rad', scale: 0.01 },
      { name: 'flags', labels: 'joint', bits: ['homed', 'a|b'] },
    ];
    const schema = parseSchema(JSON.stringify({ type: 'schema', v: 1, robot: 'r', labels, fields }));
    const table = new CsvTable([schema]);
    expect(table.head).toBe('time,seconds,robot_time,pos.=J [rad],pos.K [rad],flags.=J,flags.K\r\n');
    const codes = Int32Array.from([-314, -(2 ** 28), 3, 0]);
    const first = table.row({ schema, atUs: FROM_MS * 1000 + 999, tS: 1.5, codes });
    expect(first).toBe('2025-11-24T16:00:00.000Z,0.000,1.500,-3.14,,homed|a\\|b,0\r\n');
    const next = table.row({
      schema,
      atUs: FROM_MS * 1000 + 33_333,
      tS: 1.533,
      codes: codes.fill(-(2 ** 28)),
    });
    expect(next).toBe('2025-11-24T16:00:00.033Z,0.033,1.533,,,,\r\n');
  });
});

describe('a recording in one file', () => {
  it('has all that the reader of recordings wants, and the segments byte for byte', async () => {
    const happened = [
      { atMs: FROM_MS + 3000, event: fault(7, FROM_MS + 3000, 'jam') },
      { atMs: FROM_MS + 9100, word: 'silent' as const },
    ];
    const rig = stage(90, {}, { happened, wordBefore: 'offline' });
    const { blob, name, lost } = await saveSpan('posecast', all(rig), rig);
    expect(name).toMatch(/^r_2025-11-2\d_\d\d-\d\d-\d\d\.posecast$/);
    expect(lost).toEqual({ segments: 0, models: 0 });
    const files = unzipSync(await bytesOf(blob));
    const recording = decodeRecording(files['recording.json']!);
    expect(recording).toMatchObject({ robot: 'r', view: 'public', models: [MODEL], ...all(rig) });
    expect([...recording.schemas]).toEqual([[sha256Of(SCHEMA.text), SCHEMA.text]]);
    expect(recording.segments.length).toBe(rig.refs.length);
    for (const [i, { take, index, bytes, frames }] of recording.segments.entries()) {
      const file = files[`segments/${take}/${index}.segment`]!;
      expect(sha256Of(file)).toBe(rig.refs[i]!.sha256);
      expect([bytes, frames]).toEqual([file.length, rig.refs[i]!.frames]);
    }
    expect(recording.segments.flatMap(({ events }) => events.map(eventOf))).toMatchObject([
      { n: 7, text: 'jam' },
    ]);
    expect(recording.segments[0]!.words).toEqual([{ atMs: FROM_MS, word: 'offline' }]);
    expect(recording.segments.at(-1)!.words.at(-1)).toEqual({ atMs: FROM_MS + 9100, word: 'silent' });
    const keys = decodeKeyPage(files['keys/2025-11-24T16-00Z.keys']!);
    expect(keys.poses.map(nameOf)).toEqual(rig.refs.filter(({ frames }) => frames > 0).map(nameOf));
    expect(new TextDecoder().decode(files[`models/${MODEL}/manifest.json`])).toBe(MANIFEST);
    expect(new TextDecoder().decode(files[`models/${MODEL}/parts/a b.bin`])).toBe('of parts/a b.bin');
  });

  it('is whole segments: a bit of one is all of it', async () => {
    const rig = stage(90);
    const span = { fromMs: FROM_MS + 2500, toMs: FROM_MS + 2600 };
    const { blob } = await saveSpan('posecast', span, rig);
    const recording = decodeRecording(unzipSync(await bytesOf(blob))['recording.json']!);
    expect(recording.segments.length).toBe(1);
    expect(recording.fromMs).toBeLessThan(span.fromMs);
  });

  it('says that a model, or a file of it, is not in it', async () => {
    const rig = stage(30);
    rig.lostFiles.add('lod0.glb');
    const { blob, lost } = await saveSpan('posecast', all(rig), rig);
    expect(lost).toEqual({ segments: 0, models: 1 });
    const files = unzipSync(await bytesOf(blob));
    expect(files[`models/${MODEL}/lod0.glb`]).toBeUndefined();
    decodeRecording(files['recording.json']!);
  });
});

describe('what can’t be had', () => {
  it.each(FORMATS)('is left out of %s, and counted', async (format) => {
    const rig = stage(90);
    rig.lost.set(nameOf(rig.refs[1]!), 'gone').set(nameOf(rig.refs[2]!), 'away');
    const { blob, lost } = await saveSpan(format, all(rig), rig);
    expect(lost.segments).toBe(2);
    const left =
      rig.refs.reduce((sum, { frames }) => sum + frames, 0) - rig.refs[1]!.frames - rig.refs[2]!.frames;
    if (format === 'csv') expect((await csvLines(blob)).length).toBe(1 + left);
  });

  it.each([
    ['away', 'away'],
    ['damaged', 'nothing'],
    ['gone', 'nothing'],
  ] as const)('%s: where it is all, nothing is saved', async (why, said) => {
    const rig = stage(30);
    for (const ref of rig.refs) rig.lost.set(nameOf(ref), why);
    await expect(saveSpan('csv', all(rig), rig)).rejects.toMatchObject({ name: 'SaveError', why: said });
  });

  it('is refused before anything is fetched: nothing, more than ten minutes, more than fits', async () => {
    const rig = stage(30);
    const empty = { fromMs: FROM_MS - 9000, toMs: FROM_MS - 8000 };
    await expect(saveSpan('csv', empty, rig)).rejects.toMatchObject({ why: 'nothing' });
    await expect(measureSpan('csv', empty, rig)).rejects.toMatchObject({ why: 'nothing' });
    const long = { fromMs: FROM_MS, toMs: FROM_MS + 600_001 };
    await expect(saveSpan('csv', long, rig)).rejects.toMatchObject({ why: 'too-long' });
    await expect(measureSpan('csv', long, rig)).rejects.toMatchObject({ why: 'too-long' });
    const large = rig.refs.map((ref) => ({ ...ref, bytes: 1e9 }));
    const source = { ...rig.source, segmentsIn: () => large };
    const ports = { ...rig, models: rig.models, breathe: rig.breathe, onProgress: rig.onProgress, source };
    await expect(saveSpan('csv', all(rig), ports)).rejects.toMatchObject({ why: 'too-long' });
    await expect(measureSpan('csv', all(rig), ports)).rejects.toMatchObject({ why: 'too-long' });
  });

  it('a segment that is another one than was asked for counts as lost', async () => {
    const rig = stage(90);
    const bytes = await rig.source.segmentBytes(rig.refs[0]!);
    const source = { ...rig.source, segmentBytes: async () => bytes };
    const ports = { ...rig, models: rig.models, breathe: rig.breathe, onProgress: rig.onProgress, source };
    expect((await saveSpan('csv', all(rig), ports)).lost.segments).toBe(rig.refs.length - 1);
  });
});

describe('saving', () => {
  it.each(FORMATS)('%s breathes, tells how far it is, and ends when it is told to', async (format) => {
    const rig = stage(200);
    await saveSpan(format, all(rig), rig);
    expect(rig.breaths).toBeGreaterThan(5);
    expect(rig.progress.at(-1)).toBe(1);
    expect(rig.progress).toEqual([...rig.progress].sort((a, b) => a - b));
    const other = stage(200);
    const breathe = async () => other.leave.abort(new Error('enough'));
    const ports = {
      ...other,
      source: other.source,
      models: other.models,
      onProgress: other.onProgress,
      breathe,
    };
    await expect(saveSpan(format, all(other), { ...ports, signal: other.signal })).rejects.toThrow('enough');
  });

  it.each(FORMATS)('measures %s about as large as it becomes', async (format) => {
    const rig = stage(300, { everyMs: 33 });
    const { frames, bytes, untilMs } = await measureSpan(format, all(rig), rig);
    expect(frames).toBe(300);
    expect(untilMs).toBe(all(rig).toMs);
    const { size } = (await saveSpan(format, all(rig), rig)).blob;
    expect(bytes / size).toBeGreaterThan(0.7);
    expect(bytes / size).toBeLessThan(1.4);
    const half = { fromMs: FROM_MS, toMs: FROM_MS + 5000 };
    expect((await measureSpan(format, half, rig)).frames).toBeCloseTo(5000 / 33, -1);
  });

  it('holds no more than a part of the file itself', async () => {
    const file = new BlobParts();
    const piece = new Uint8Array(1000).fill(7);
    for (let i = 0; i < 9000; i++) file.write(piece);
    piece.fill(0); // it had a copy
    file.write('é');
    const bytes = await bytesOf(file.blob('x/y'));
    expect([bytes.length, bytes[0], bytes[8_999_999], ...bytes.subarray(-2)]).toEqual([
      9_000_002, 7, 7, 0xc3, 0xa9,
    ]);
  });

  it('names a file by robot and moment', () => {
    const at = new Date(2026, 10, 2, 4, 2, 7).getTime();
    expect(fileName('demo', at, 'csv')).toBe('demo_2026-11-02_04-02-07.csv');
  });
});
