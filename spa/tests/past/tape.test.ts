import { describe, expect, it, vi } from 'vitest';
import { firstPlace } from '../../src/kit.ts';
import { newestAt, readerOf, TAPE_BYTES_MAX, Tape, TapePart } from '../../src/past/player/tape/tape.ts';
import { FakeSource } from '../rigs/past_player_rig.ts';
import { FROM_MS, fault, RUN, recorded, SCHEMA, type Sent, schemaOf, sent } from '../rigs/past_recordings.ts';

async function partsOf(segments: ReturnType<typeof recorded>, schema = SCHEMA): Promise<TapePart[]> {
  const source = new FakeSource(segments);
  const span = { fromMs: FROM_MS, toMs: FROM_MS + 3_600_000 };
  await source.loadIndex(span);
  const reader = readerOf(schema);
  const found = await Promise.all(source.segmentsIn(span).map((ref) => source.segment(ref)));
  return found.map((segment, i) => new TapePart(source.segmentsIn(span)[i]!, segment, reader));
}

describe('TapePart', () => {
  it('has frames with their moments and lateness, decoded once', async () => {
    const frames = sent(50);
    const [, part] = await partsOf(recorded(frames));
    const decode = vi.spyOn(part!.reader!.decoder, 'decode');
    expect(part!.isOpen).toBe(false);
    expect(part!.bytes).toBe(part!.ref.bytes);
    expect(part!.frames.map(({ seq, codes, tS }) => [seq, [...codes], tS])).toEqual(
      frames.slice(20, 40).map(({ seq, codes, tS }) => [seq, [...codes], expect.closeTo(tS, 3)]),
    );
    expect(part!.frames[3]).toMatchObject({
      runId: RUN,
      atMs: FROM_MS + 2300,
      lateMs: 5,
      schemaId: SCHEMA.id,
    });
    expect(decode).toHaveBeenCalledTimes(20);
    expect(part!.bytes).toBe(part!.ref.bytes + 20 * 4 * SCHEMA.size);
  });

  it('counts what a segment holds where its index says less', async () => {
    const [whole] = await partsOf(recorded(sent(50)));
    const text = JSON.stringify(fault(1, FROM_MS, 'x'.repeat(3000)));
    const records = Array.from({ length: 100 }, (_, i) => ({ kind: 'event', atUs: i, text }) as const);
    const { start } = recorded(sent(1))[0]!;
    const part = new TapePart({ ...whole!.ref, bytes: 1 }, { start, toMs: FROM_MS, records }, whole!.reader);
    expect(part.bytes).toBeGreaterThan(300_000);
  });

  it('leaves out what can not be decoded', async () => {
    const frames = sent(20);
    frames[7]!.frame.fill(0xff, 9);
    const [part] = await partsOf(recorded(frames));
    expect(part!.frames.map(({ seq }) => seq)).toEqual([...frames.keys()].filter((seq) => seq !== 7));
  });

  it('reads only some frames of a segment that has too much', async () => {
    const schema = schemaOf(4000);
    const [part] = await partsOf(recorded(sent(1, { schema })), schema);
    const [{ frame, seq }] = sent(1, { schema }) as [Sent];
    const records = Array.from(
      { length: 1100 },
      (_, i) => ({ kind: 'frame', atUs: 1000 * i, lateUs: 0, seq, frame }) as const,
    );
    const { start } = recorded(sent(1, { schema }))[0]!;
    const large = new TapePart(part!.ref, { start, toMs: FROM_MS + 3000, records }, readerOf(schema));
    expect(large.frames.map(({ atMs }) => atMs - FROM_MS)).toEqual(
      Array.from({ length: 550 }, (_, i) => 2 * i),
    );
    expect(large.bytes).toBeLessThanOrEqual(TAPE_BYTES_MAX + part!.ref.bytes);
  });

  it('says what was so at a moment', async () => {
    const at = (s: number): number => FROM_MS + 1000 * s;
    const happened = [
      { atMs: at(0.5), event: fault(1, at(0.5), 'hot') },
      { atMs: at(2.5), event: fault(2, at(2.5), 'jam') },
      { atMs: at(3.5), event: fault(3, at(3.5), 'hot', 'off') },
      { atMs: at(3.7), word: 'silent' as const },
    ];
    const [, part] = await partsOf(recorded(sent(50), { happened }));
    const said = (s: number) => {
      const { faults, word } = part!.situationAt(at(s));
      return [...faults.map(({ text }) => text), word];
    };
    expect(said(2)).toEqual(['hot', 'online']);
    expect(said(3)).toEqual(['hot', 'jam', 'online']);
    expect(said(3.6)).toEqual(['jam', 'online']);
    expect(said(3.8)).toEqual(['jam', 'silent']);
    expect(part!.happenings.map(({ kind, place }) => [kind, place])).toEqual([
      ['start', 0],
      ['event', 6],
      ['event', 16],
      ['word', 18],
    ]);
  });
});

describe('Tape', () => {
  it('keeps to its bound by dropping what is farthest', async () => {
    const small = await partsOf(recorded(sent(600)));
    const parts = small.map(({ ref }) => new TapePart({ ...ref, bytes: 1e6 }, recorded(sent(1))[0]!, null));
    const tape = new Tape();
    const momentMs = FROM_MS + 40_000;
    for (const part of parts) tape.add(part);
    expect(tape.bytes).toBeGreaterThan(TAPE_BYTES_MAX);
    tape.trim(momentMs);
    expect(tape.bytes).toBeLessThanOrEqual(TAPE_BYTES_MAX);
    expect(tape.bytes).toBeGreaterThan(TAPE_BYTES_MAX * 0.9);
    const kept = parts.filter(({ ref }) => tape.get(ref) !== null);
    const farMs = (each: TapePart): number => Math.max(each.ref.fromMs - momentMs, momentMs - each.ref.toMs);
    const dropped = parts.filter((part) => !kept.includes(part));
    expect(Math.max(...kept.map(farMs))).toBeLessThanOrEqual(Math.min(...dropped.map(farMs)));
  });

  it('orders frames by run and number, which goes round', async () => {
    const [part] = await partsOf(recorded(sent(2)));
    const tape = new Tape();
    const [a] = part!.frames;
    const frame = (runId: string, seq: number, atMs: number) => ({ ...a!, runId, seq, atMs });
    tape.learnRun('x', 100);
    tape.learnRun('y', 200);
    expect(tape.order(frame('x', 2, 0), frame('x', 1, 9))).toBeGreaterThan(0);
    expect(tape.order(frame('x', 1, 0), frame('x', 2 ** 32 - 1, 9))).toBeGreaterThan(0);
    expect(tape.order(frame('x', 5, 1), frame('x', 5, 2))).toBe(0);
    expect(tape.order(frame('y', 1, 205), frame('x', 9, 210))).toBeGreaterThan(0);
    expect(tape.order(frame('own 1', 1, 205), frame('x', 9, 210))).toBeLessThan(0);
  });
});

it('finds places in what is ordered', () => {
  const list = [1, 3, 3, 7].map((atMs) => ({ atMs }));
  expect([0, 1, 3, 8].map((ms) => firstPlace(list, ({ atMs }) => atMs > ms))).toEqual([0, 1, 3, 4]);
  expect([0, 1, 6, 8].map((ms) => newestAt(list, ms)?.atMs ?? null)).toEqual([null, 1, 3, 7]);
});
