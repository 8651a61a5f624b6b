import { describe, expect, it } from 'vitest';
import { OWN_BYTES_MAX, OwnTape } from '../../src/past/player/tape/own_tape.ts';
import { readerOf, type TapeFrame } from '../../src/past/player/tape/tape.ts';
import { FROM_MS, fault, RUN, SCHEMA, type Sent, schemaOf, sent } from '../rigs/past_recordings.ts';

/** Ahead of the relay's clock, ms. */
const PAGE_MS = 5_000_000;

function tapeOf(frames: readonly Sent[], schema = SCHEMA, tape = new OwnTape()): OwnTape {
  for (const { seq, tS, codes, atMs } of frames) {
    const state = { schemaId: schema.id, seq, tS, codes, freshMs: 0, bornMs: 0, changedMs: 0 };
    tape.push(schema, { ...state, atMs: atMs + PAGE_MS + 30, lateMs: 30 });
  }
  return tape;
}

function asRecorded(frames: readonly Sent[], runId = RUN): TapeFrame[] {
  const { schema } = readerOf(SCHEMA);
  return frames.map(({ seq, tS, codes, atMs }) => ({
    ...{ seq, tS, codes, atMs, runId, schema, schemaId: schema.id, lateMs: 0 },
  }));
}

describe('OwnTape', () => {
  it('keeps the newest minute, with codes of its own', () => {
    const frames = sent(1000);
    const tape = tapeOf(frames);
    frames[999]!.codes[0] = 7;
    expect(tape.since(0).map(({ seq }) => seq)).toEqual(Array.from({ length: 601 }, (_, i) => 399 + i));
    expect(tape.newest!.codes[0]).toBe(999);
    expect(tape.bytes).toBe(601 * 4 * SCHEMA.size);
  });

  it('has what came behind at the moments at which the relay had it, also where a socket was before', () => {
    const frames = sent(80);
    const tape = tapeOf(frames.slice(0, 40));
    const behindMs = 4000;
    for (const { seq, tS, codes, atMs } of frames.slice(40))
      tape.push(
        SCHEMA,
        {
          ...{ schemaId: SCHEMA.id, seq, tS, codes, freshMs: 0, bornMs: 0, changedMs: 0, lateMs: 0 },
          atMs: atMs + PAGE_MS + behindMs,
        },
        behindMs,
      );
    expect(tape.since(0).map(({ atMs }) => atMs - PAGE_MS)).toEqual(frames.map(({ atMs }) => atMs));
    expect(tape.align(asRecorded(frames))?.byMs, 'one difference of the clocks').toBe(-PAGE_MS);
  });

  it('forgets what was deleted', () => {
    const tape = tapeOf(sent(10));
    tape.align(asRecorded(sent(10)));
    tape.event(fault(1, FROM_MS + 250, 'jam'), FROM_MS + PAGE_MS + 250);
    tape.forget([{ fromMs: FROM_MS + 200, toMs: FROM_MS + 500 }]);
    expect(tape.since(0).map(({ seq }) => seq)).toEqual([0, 1, 5, 6, 7, 8, 9]);
    expect(tape.bytes).toBe(7 * 4 * SCHEMA.size);
    expect(tape.happenings(0, FROM_MS + 1000)).toEqual([]);
  });

  it('keeps to its bound', () => {
    const schema = schemaOf(4000);
    const [one] = sent(1, { schema }) as [Sent];
    const many = Array.from({ length: 600 }, (_, seq) => ({ ...one, seq, atMs: FROM_MS + 100 * seq }));
    const tape = tapeOf(many, schema);
    expect(tape.bytes).toBeLessThanOrEqual(OWN_BYTES_MAX);
    expect(tape.since(0)).toHaveLength(500);
  });

  it('finds states by moment, leaves out what comes again, and begins a run where numbers fall', () => {
    const first = sent(10, { firstSeq: 50 });
    const tape = tapeOf([...first, ...first.slice(8), ...sent(5, { fromMs: FROM_MS + 1000 })]);
    expect(tape.since(0).map(({ runId, seq }) => [runId, seq])).toEqual([
      ...first.map(({ seq }) => ['own 1', seq]),
      ...[0, 1, 2, 3, 4].map((seq) => ['own 2', seq]),
    ]);
    const at = (ms: number) => tape.at(FROM_MS + PAGE_MS + ms)?.seq ?? null;
    expect([at(-1), at(0), at(950), at(1000), at(9999)]).toEqual([null, 50, 59, 0, 4]);
  });

  it('learns run and clock from a segment that has some of its frames', () => {
    const frames = sent(40);
    const tape = tapeOf(frames.slice(20));
    const offset = -PAGE_MS;
    expect(tape.align(asRecorded(frames.slice(0, 25)))).toEqual({
      formerRun: 'own 1',
      runId: RUN,
      byMs: offset,
    });
    expect(tape.newest).toMatchObject({ runId: RUN, atMs: frames[39]!.atMs });
    expect(tape.align(asRecorded(frames.slice(25)))).toBeNull();
  });

  it('learns nothing from frames of another run that have the same numbers', () => {
    const tape = tapeOf(sent(40));
    const other = sent(40).map((frame) => ({ ...frame, codes: frame.codes.map((code) => code + 1) }));
    expect(tape.align(asRecorded(other, 'another'))).toBeNull();
    expect(tape.align(asRecorded(sent(40)))).not.toBeNull();
    expect(tape.align(asRecorded(sent(40), 'another'))).toBeNull();
    expect(tape.newest!.runId).toBe(RUN);
  });

  it('takes the page’s clock as it is until it is plainly off', () => {
    const tape = tapeOf(sent(10));
    const newestMs = tape.newest!.atMs;
    for (const [aheadMs, movedMs] of [
      [-20_000, 0],
      [2000, 0],
      [-PAGE_MS, -PAGE_MS],
      [5000, 5000],
    ] as const) {
      tape.guess(newestMs + aheadMs);
      expect(tape.newest!.atMs - newestMs).toBe(movedMs);
    }
  });

  it('says what was so at a moment, also when that is older than what it keeps', () => {
    const tape = new OwnTape();
    const frames = sent(900);
    const at = (s: number): number => FROM_MS + PAGE_MS + 1000 * s;
    tape.word('online', at(0));
    tape.model('ab', at(0));
    tape.info(new Map([['site', 'lab']]), at(0));
    tape.event(fault(1, at(0), 'hot'), at(0));
    tapeOf(frames, SCHEMA, tape);
    tape.event(fault(2, at(85), 'jam'), at(85));
    tape.event(fault(1, at(0), 'hot'), at(86)); // repeated
    tape.event(fault(3, at(87), 'jam', 'off'), at(87));
    tape.word('silent', at(88));
    tape.word('silent', at(89));
    const said = (s: number) => {
      const { faults, word, model, info } = tape.situationAt(at(s));
      return [...faults.map(({ text }) => text), word, model, info.get('site')];
    };
    expect(said(84)).toEqual(['hot', 'online', 'ab', 'lab']);
    expect(said(86.5)).toEqual(['hot', 'jam', 'online', 'ab', 'lab']);
    expect(said(89)).toEqual(['hot', 'silent', 'ab', 'lab']);
    expect(tape.happenings(at(85), at(90)).map(({ kind }) => kind)).toEqual(['event', 'word']);
  });
});
