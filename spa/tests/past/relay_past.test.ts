import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { decodeKeyPage, decodeSegment, encodeKeyPage, parseSchema } from '@posecast/wire';
import { afterEach, describe, expect, it, vi } from 'vitest';
import type { PastError, SegmentRef } from '../../src/past/past_source.ts';
import type { RelayPast } from '../../src/past/relay/relay_past.ts';
import { BASE, entry, event, json, minute, PastRig, settled, summary, TAKE } from '../rigs/past_rig.ts';

const at = (time: string) => Date.parse(`2026-11-22T${time}Z`);
const [FROM, TO] = [at('14:05:00'), at('14:23:30')];
const ALL = { fromMs: 0, toMs: Number.MAX_SAFE_INTEGER };
const VECTORS = new URL('../../../wire/vectors/', import.meta.url);
const read = (name: string) => new Uint8Array(readFileSync(new URL(name, VECTORS)));
const sha256 = (data: Uint8Array | string) => createHash('sha256').update(data).digest('hex');
const binary = (data: Uint8Array) =>
  new Response(new Uint8Array(data), { headers: { 'content-type': 'application/octet-stream' } });
const why = (promise: Promise<unknown>) =>
  promise.then(
    () => 'fine',
    (error: PastError) => error.why ?? error.name,
  );

let past: RelayPast | null = null;
afterEach(() => {
  past?.close();
  vi.unstubAllGlobals();
});

function withPast(): PastRig {
  const rig = new PastRig();
  rig.answer('', summary(FROM, TO));
  const minutes = ['14:05', '14:12', '14:23'].map((time) => minute(`2026-11-22T${time}Z`, { faults: 1 }));
  rig.answer('/public/2026-11-22', { minutes });
  const page = (time: string, segments: readonly unknown[]) =>
    rig.answer(`/public/2026-11-22T${time}Z`, { segments, more: false });
  page('14:00', [entry(0, FROM)]);
  page('14:10', [entry(1, at('14:12:00'))]);
  page('14:20', [entry(2, at('14:23:20')), entry(3, at('14:23:26'))]);
  return rig;
}

async function opened(rig: PastRig): Promise<RelayPast> {
  past = rig.open();
  await settled();
  return past;
}

describe('opening', () => {
  it('asks only how far back and for the minutes', async () => {
    const rig = withPast();
    const told = vi.fn();
    past = rig.open();
    past.onChange(told);
    await settled();
    expect(rig.takeAsked()).toEqual(['', '/public/2026-11-22']);
    expect(past.timeline).toMatchObject({ fromMs: FROM, toMs: TO });
    expect(past.timeline!.movement).toHaveLength(3);
    expect(told).toHaveBeenCalledTimes(1);
    expect(rig.headers).toEqual({});
  });

  it('shows the token that there is for the address', async () => {
    const rig = withPast();
    rig.token = 'pc1.demo.x';
    await opened(rig);
    expect(rig.headers).toEqual({ authorization: 'Bearer pc1.demo.x' });
  });

  it.each([401, 403, 404, 501])(
    'finds no past where the relay answers %i, and asks again in a minute',
    async (status) => {
      const rig = new PastRig();
      rig.answer('', { detail: 'no' }, status);
      const source = await opened(rig);
      expect(source.timeline).toBeNull();
      expect(await why(source.loadIndex(ALL))).toBe('gone');
      await rig.clock.pass(58_000);
      expect(rig.takeAsked()).toEqual(['']);
      rig.answer('', summary(FROM, TO));
      await rig.clock.pass(4000);
      expect(source.timeline).not.toBeNull();
    },
  );

  it('finds a past that begins later, and one that ends', async () => {
    const rig = withPast();
    rig.answer('', summary(FROM, TO, { newest: null, from_ms: null, to_ms: null, days: [] }));
    const source = await opened(rig);
    expect(source.timeline).toBeNull();
    rig.answer('', summary(FROM, TO));
    await rig.clock.pass(16_000);
    expect(source.timeline).not.toBeNull();
    rig.answer('', summary(FROM, TO, { past_ms: 0 }));
    await rig.clock.pass(16_000);
    expect(source.timeline).toBeNull();
  });

  it('is tried again where nobody answers, and what is known stays', async () => {
    const rig = withPast();
    const source = await opened(rig);
    rig.answers.set('', () => Promise.reject(new TypeError('failed')));
    await rig.clock.pass(40_000);
    expect(source.timeline).toMatchObject({ toMs: TO });
    expect(rig.takeAsked().length).toBeLessThan(10);
    rig.answer('', summary(FROM, TO + 9000));
    await rig.clock.pass(16_000);
    expect(source.timeline).toMatchObject({ toMs: TO + 9000 });
  });

  it.each([
    ['no JSON', '<!doctype html>'],
    ['no summary', '{"view": 7}'],
  ])('takes %s for damage', async (_, body) => {
    const rig = new PastRig();
    rig.answer('', body);
    const source = await opened(rig);
    expect(source.timeline).toBeNull();
    expect(await why(source.loadKeys(ALL))).toBe('damaged');
    rig.takeAsked();
    await rig.clock.pass(30_000);
    expect(rig.takeAsked()).toEqual([]);
  });
});

describe('what is newest', () => {
  it('is asked for every 15 s while idle, and not while the page is hidden', async () => {
    const rig = withPast();
    const source = await opened(rig);
    source.follow('idle');
    rig.takeAsked();
    await rig.clock.pass(60_000);
    expect(rig.takeAsked()).toEqual(['', '', '']);
    rig.hidden = true;
    await rig.clock.pass(600_000);
    expect(rig.takeAsked()).toEqual([]);
    rig.hidden = false;
    await rig.clock.pass(2000);
    expect(rig.takeAsked()).toEqual(['']);
  });

  it('is asked for every two seconds while near, once a page was fetched', async () => {
    const rig = withPast();
    const source = await opened(rig);
    source.follow('near');
    await settled();
    await rig.clock.pass(4000);
    rig.takeAsked();
    await source.loadIndex({ fromMs: TO, toMs: TO });
    const after = `/public/2026-11-22T14:20Z?after=${TAKE},3`;
    rig.answer(after, { segments: [entry(4, TO)], more: false });
    await rig.clock.pass(2000);
    expect(rig.takeAsked()).toEqual(['/public/2026-11-22T14:20Z', after]);
    expect(source.timeline).toMatchObject({ toMs: TO + 4000 });
    rig.answer(`/public/2026-11-22T14:20Z?after=${TAKE},4`, { segments: [], more: false });
    const before = source.timeline;
    await rig.clock.pass(4000);
    expect(source.timeline).toBe(before);
  });

  it('goes on in the next ten minutes', async () => {
    const rig = withPast();
    rig.answer('', summary(FROM, at('14:29:56')));
    rig.answer('/public/2026-11-22T14:20Z', { segments: [entry(3, at('14:29:52'))], more: false });
    const source = await opened(rig);
    source.follow('near');
    await source.loadIndex(ALL);
    const [ending, beginning] = [`/public/2026-11-22T14:20Z?after=${TAKE},3`, '/public/2026-11-22T14:30Z'];
    rig.answer(ending, { segments: [], more: false });
    rig.answer(beginning, { segments: [], more: false });
    rig.takeAsked();
    await rig.clock.pass(2000);
    expect(rig.takeAsked(), 'at 14:29:58').toEqual([ending]);
    await rig.clock.pass(2000);
    expect(rig.takeAsked().sort(), 'at 14:30:00').toEqual([ending, beginning]);
    rig.answer(ending, { segments: [entry(4, at('14:29:58'))], more: false });
    rig.answer(beginning, { segments: [entry(5, at('14:30:02'))], more: false });
    await rig.clock.pass(2000);
    expect(
      source.segmentsIn({ fromMs: at('14:29:00'), toMs: at('14:31:00') }).map(({ index }) => index),
    ).toEqual([3, 4, 5]);
    rig.answer(`/public/2026-11-22T14:20Z?after=${TAKE},4`, { segments: [], more: false });
    rig.answer(`/public/2026-11-22T14:30Z?after=${TAKE},5`, { segments: [], more: false });
    await rig.clock.pass(8000);
    rig.takeAsked();
    await rig.clock.pass(2000);
    const pages = rig.takeAsked().filter((path) => path.includes('T14'));
    expect(pages, 'the page of before has closed').toEqual([`/public/2026-11-22T14:30Z?after=${TAKE},5`]);
  });

  it('is not asked for of a relay that does not answer as often', async () => {
    const rig = withPast();
    const source = await opened(rig);
    source.follow('near');
    await source.loadIndex(ALL);
    rig.answers.clear();
    for (const path of ['', `/public/2026-11-22T14:20Z?after=${TAKE},3`]) rig.answer(path, {}, 503);
    rig.takeAsked();
    await rig.clock.pass(60_000);
    expect(rig.takeAsked().length).toBeLessThan(14);
  });
});

describe('the index', () => {
  it('is fetched once, and again only for what is new', async () => {
    const rig = withPast();
    const source = await opened(rig);
    rig.takeAsked();
    await Promise.all([source.loadIndex(ALL), source.loadIndex(ALL)]);
    expect(rig.takeAsked().sort()).toEqual(
      ['14:00', '14:10', '14:20'].map((time) => `/public/2026-11-22T${time}Z`),
    );
    expect(source.segmentsIn(ALL).map(({ index }) => index)).toEqual([0, 1, 2, 3]);
    await source.loadIndex(ALL);
    expect(rig.takeAsked()).toEqual([]);
  });

  it('is fetched to its end', async () => {
    const rig = withPast();
    const events = [event(1, at('14:23:21'))];
    rig.answer('/public/2026-11-22T14:20Z', { segments: [entry(2, at('14:23:20'), { events })], more: true });
    rig.answer(`/public/2026-11-22T14:20Z?after=${TAKE},2`, {
      segments: [entry(3, at('14:23:26'))],
      more: false,
    });
    const source = await opened(rig);
    await source.loadIndex(ALL);
    expect(source.segmentsIn(ALL).map(({ index }) => index)).toEqual([0, 1, 2, 3]);
    expect(source.timeline!.marks).toMatchObject([{ atMs: at('14:23:21'), exact: true }]);
  });

  it('that has no end is damaged', async () => {
    const rig = withPast();
    const endless = { segments: [entry(2, at('14:23:20'))], more: true };
    rig.answer('/public/2026-11-22T14:20Z', endless);
    rig.answer(`/public/2026-11-22T14:20Z?after=${TAKE},2`, endless);
    const source = await opened(rig);
    rig.takeAsked();
    expect(await why(source.loadIndex({ fromMs: TO, toMs: TO }))).toBe('damaged');
    expect(rig.takeAsked()).toHaveLength(2);
  });

  it('that is longer than any is damaged, and is not read to its end', async () => {
    const rig = withPast();
    rig.answer('/public/2026-11-22T14:20Z', `"${'x'.repeat(3e6)}"`);
    const source = await opened(rig);
    const error = await source.loadIndex({ fromMs: TO, toMs: TO }).catch((cause: unknown) => cause);
    expect(error).toMatchObject({
      why: 'damaged',
      message: expect.stringMatching(/more than 3000000 bytes$/),
    });
  });
});

describe('a deletion', () => {
  const span = { from_ms: at('14:12:01'), to_ms: at('14:12:30') };
  const deleted = (rig: PastRig) => rig.answer('', summary(FROM, TO, { deleted: [span] }));

  it('is seen within half a minute, and takes segments, events and marks away', async () => {
    const rig = withPast();
    const page = {
      segments: [entry(1, at('14:12:00'), { events: [event(7, at('14:12:02'))] })],
      more: false,
    };
    rig.answer('/public/2026-11-22T14:10Z', page);
    const source = await opened(rig);
    await source.loadIndex({ fromMs: at('14:10:00'), toMs: at('14:12:59') });
    expect(source.segmentsIn(ALL).map(({ index }) => index)).toEqual([1]);
    expect(source.timeline!.marks.map(({ atMs }) => atMs)).toContain(at('14:12:02'));
    const told = vi.fn();
    source.onChange(told);
    deleted(rig);
    await rig.clock.pass(17_000);
    expect(told).toHaveBeenCalled();
    expect(source.deleted).toEqual([{ fromMs: span.from_ms, toMs: span.to_ms }]);
    expect(source.segmentsIn(ALL)).toEqual([]);
    expect(source.timeline!.marks.map(({ atMs }) => atMs)).toEqual([FROM, at('14:23:00')]);
    const before = source.deleted;
    await rig.clock.pass(17_000);
    expect(source.deleted, 'no news').toBe(before);
  });

  it('counts also if caches or other relays still have the lists of before', async () => {
    const rig = withPast();
    deleted(rig);
    const source = await opened(rig);
    await source.loadIndex(ALL);
    expect(source.segmentsIn(ALL).map(({ index }) => index)).toEqual([0, 2, 3]);
    expect(source.timeline!.marks.map(({ atMs }) => atMs)).not.toContain(at('14:12:00'));
    rig.answer('', summary(FROM, TO, { deleted: [] })); // by a relay that has not heard of it
    await rig.clock.pass(17_000);
    expect(source.segmentsIn(ALL).map(({ index }) => index)).toEqual([0, 2, 3]);
  });

  it('of everything leaves nothing', async () => {
    const rig = withPast();
    const source = await opened(rig);
    await source.loadIndex(ALL);
    const none = { newest: null, from_ms: null, to_ms: null, days: [] };
    rig.answer('', summary(FROM, TO, { ...none, deleted: [{ from_ms: 0, to_ms: TO }] }));
    await rig.clock.pass(17_000);
    expect(source.timeline).toBeNull();
    expect(source.deleted).toEqual([{ fromMs: 0, toMs: TO }]);
    expect(source.segmentsIn(ALL)).toEqual([]);
  });

  it('that is no list of spans is damaged', async () => {
    for (const wrong of [
      {},
      [{}],
      [{ from_ms: 1 }],
      [{ from_ms: 2, to_ms: 'x' }],
      [{ from_ms: -1, to_ms: 2 }],
    ]) {
      const rig = withPast();
      rig.answer('', summary(FROM, TO, { deleted: wrong }));
      const source = await opened(rig);
      expect(source.deleted).toEqual([]);
      source.close();
    }
  });
});

describe('first poses', () => {
  const held = decodeKeyPage(read('key_pages/demo.pck'));
  const data = encodeKeyPage(
    held,
    held.poses.map((pose) => ({ ...pose, atMs: pose.atMs + 5000 })),
  );
  const page = decodeKeyPage(data);
  const path = `/public/${new Date(page.fromMs).toISOString().slice(0, 16)}Z`;
  const poses = page.poses;
  const first = poses[0]!;
  const newest = poses.at(-1)!;

  function withKeys(toMs = page.fromMs + 700_000): PastRig {
    const rig = new PastRig();
    rig.answer('', summary(page.fromMs, toMs));
    rig.answer(`/public/${new Date(page.fromMs).toISOString().slice(0, 10)}`, {
      minutes: [minute(path.slice(8))],
    });
    rig.answers.set(`${path}/keys`, () => binary(data));
    rig.answer(path, { segments: [entry(0, page.fromMs)], more: false });
    return rig;
  }

  it('are fetched once of ten minutes that are over', async () => {
    const rig = withKeys();
    const source = await opened(rig);
    expect(source.keyAt(first.atMs)).toBeNull();
    rig.takeAsked();
    const span = { fromMs: page.fromMs, toMs: page.fromMs + 500_000 };
    await Promise.all([source.loadKeys(span), source.loadKeys(span)]);
    await rig.clock.pass(4000);
    await source.loadKeys(span);
    expect(rig.takeAsked()).toEqual([`${path}/keys`]);
    expect(source.keyAt(first.atMs - 1), 'the oldest behind it').toEqual(first);
    expect(source.keyAt(newest.atMs + 0.5)).toEqual(newest);
    expect(source.keyAt(newest.atMs - 0.5)).toEqual(poses.at(-2) ?? first);
    expect(source.keyAt(page.fromMs + 600_000)).toBeNull();
  });

  it('of a deleted segment are dropped, and left out of a page that a cache still has', async () => {
    const rig = withKeys();
    const source = await opened(rig);
    const span = { fromMs: page.fromMs, toMs: page.fromMs + 500_000 };
    await source.loadKeys(span);
    expect(source.keyAt(newest.atMs)).toEqual(newest);
    const deleted = [{ from_ms: newest.atMs + 1000, to_ms: newest.atMs + 2000 }];
    rig.answer('', summary(page.fromMs, page.fromMs + 700_000, { deleted }));
    await rig.clock.pass(17_000);
    expect(source.keyAt(newest.atMs)?.atMs ?? 0).toBeLessThan(newest.atMs - 5000);
    const again = await opened(rig);
    await again.loadKeys(span);
    expect(again.keyAt(newest.atMs)?.atMs ?? 0).toBeLessThan(newest.atMs - 5000);
    again.close();
  });

  it('are fetched again when there are new ones, every two seconds at most', async () => {
    const toMs = page.fromMs + 30_000;
    const rig = withKeys(toMs);
    const source = await opened(rig);
    const load = async () => {
      await source.loadKeys({ fromMs: page.fromMs, toMs: page.fromMs + 60_000 });
      return rig.takeAsked();
    };
    rig.takeAsked();
    expect(await load()).toEqual([`${path}/keys`]);
    rig.answer(path, { segments: [entry(0, toMs)], more: false });
    await source.loadIndex({ fromMs: page.fromMs, toMs: page.fromMs });
    expect(source.timeline).toMatchObject({ toMs: toMs + 4000 });
    rig.takeAsked();
    expect(await load(), 'it grew, but was asked for just now').toEqual([]);
    await rig.clock.pass(2000);
    expect(await load()).toEqual([`${path}/keys`]);
    await rig.clock.pass(2000);
    expect(await load(), 'it did not grow').toEqual([]);
  });

  it('are every n-th where there are too many', async () => {
    const rig = withKeys();
    const segments = Array.from({ length: 500 }, (_, i) => entry(i, page.fromMs + 1000 * i));
    rig.answer(path, { segments, more: false });
    rig.answers.set(`${path}/keys?every=3`, () => binary(data));
    const source = await opened(rig);
    const span = { fromMs: page.fromMs, toMs: page.fromMs };
    await source.loadIndex(span);
    await source.loadKeys(span);
    expect(rig.takeAsked().at(-1)).toBe(`${path}/keys?every=3`);
  });

  it('that are damaged, or another page, are refused', async () => {
    const rig = withKeys();
    const source = await opened(rig);
    rig.answers.set(`${path}/keys`, () => binary(data.subarray(1)));
    expect(await why(source.loadKeys({ fromMs: page.fromMs, toMs: page.fromMs }))).toBe('damaged');
    const other = `/public/${new Date(page.fromMs + 600_000).toISOString().slice(0, 16)}Z/keys`;
    rig.answers.set(other, () => binary(data));
    expect(await why(source.loadKeys({ fromMs: page.fromMs + 600_000, toMs: page.fromMs + 700_000 }))).toBe(
      'damaged',
    );
  });
});

describe('a segment', () => {
  const data = read('segments/key.pcs');
  const held = decodeSegment(data);
  const ref = {
    ...held.start,
    toMs: held.toMs,
    frames: 1,
    bytes: data.length,
    sha256: sha256(data),
  } as unknown as SegmentRef;
  const path = `/public/${ref.take}/${ref.index}`;

  async function withSegment(answer: (init: RequestInit) => Response | Promise<Response>) {
    const rig = withPast();
    rig.answers.set(path, answer);
    const source = await opened(rig);
    rig.takeAsked();
    return { rig, source };
  }

  it('is fetched once, checked and kept', async () => {
    const { rig, source } = await withSegment(() => binary(data));
    const [one, two] = await Promise.all([source.segment(ref), source.segment(ref)]);
    expect(one).toEqual(held);
    expect([two, await source.segment(ref)]).toEqual([one, one]);
    expect(rig.takeAsked()).toEqual([path]);
  });

  it('is had byte for byte, too: checked, not kept, and without its reader', async () => {
    const { rig, source } = await withSegment(() => binary(data));
    const [one, two] = await Promise.all([source.segmentBytes(ref), source.segmentBytes(ref)]);
    expect(Buffer.compare(one, data)).toBe(0);
    expect(two).toBe(one);
    await source.segmentBytes(ref);
    expect(rig.takeAsked()).toEqual([path, path]);
    expect(await why(source.segmentBytes({ ...ref, sha256: sha256('x') }))).toBe('damaged');
    expect(await why(source.segmentBytes({ ...ref, bytes: 7 }))).toBe('damaged');
    const { source: other } = await withSegment(() => json({ next: { take: TAKE, index: 9 } }));
    expect(await why(other.segmentBytes(ref))).toBe('gone');
  });

  it('that is not what its hash or its length says is damaged', async () => {
    const { source } = await withSegment(() => binary(data));
    expect(await why(source.segment({ ...ref, sha256: sha256('x') }))).toBe('damaged');
    expect(await why(source.segment({ ...ref, bytes: 7 }))).toBe('damaged');
    const bent = data.slice();
    bent[40]! ^= 1;
    const { source: other } = await withSegment(() => binary(bent));
    expect(await why(other.segment({ ...ref, sha256: sha256(bent) })), 'its own CRC').toBe('damaged');
  });

  it('is checked by its length and its own CRC where the browser has no hashes', async () => {
    vi.stubGlobal('crypto', {});
    const { source } = await withSegment(() => binary(data));
    expect(await source.segment({ ...ref, sha256: sha256('x') })).toEqual(held);
    const { source: other } = await withSegment(() => binary(read('segments/changes.pcs')));
    expect(await why(other.segment({ ...ref, bytes: read('segments/changes.pcs').length }))).toBe('damaged');
  });

  it.each([
    ['gone', 'the next one is named', () => json({ next: { take: TAKE, index: 9 } })],
    ['gone', '404', () => json({}, 404)],
    ['gone', '403', () => json({}, 403)],
    ['gone', '501', () => json({}, 501)],
    ['away', '503', () => json({}, 503)],
    ['away', '429', () => json({}, 429)],
    ['away', 'not yet', () => new Response(null, { status: 204 })],
    ['away', 'no network', () => Promise.reject(new TypeError('failed to fetch'))],
    ['away', 'no end', () => new Promise<Response>(() => {})],
  ] as const)('is %s: %s', async (expected, _, answer) => {
    const { rig, source } = await withSegment(answer);
    const got = why(source.segment(ref));
    await rig.clock.pass(60_000);
    expect(await got).toBe(expected);
    expect(rig.takeAsked().filter((each) => each === path)).toHaveLength(expected === 'gone' ? 1 : 2);
  });

  it('is asked for once more where nobody answered', async () => {
    let tries = 0;
    const { rig, source } = await withSegment(() => (tries++ === 0 ? json({}, 502) : binary(data)));
    const got = source.segment(ref);
    await rig.clock.pass(499);
    expect(tries).toBe(1);
    await rig.clock.pass(1);
    expect(await got).toEqual(held);
  });

  it('is given up when nobody waits for it any more', async () => {
    const signals: AbortSignal[] = [];
    let answer = (_: Response) => {};
    const { source } = await withSegment(({ signal }) => {
      signals.push(signal!);
      return new Promise<Response>((resolve) => {
        answer = resolve;
      });
    });
    const [one, two] = [new AbortController(), new AbortController()];
    const first = why(source.segment(ref, one.signal));
    const second = source.segment(ref, two.signal);
    one.abort();
    expect(await first).toBe('AbortError');
    expect(signals[0]!.aborted).toBe(false);
    answer(binary(data));
    expect(await second).toEqual(held);
    expect(await why(source.segment({ ...ref, index: 99 }, one.signal))).toBe('AbortError');

    const { source: other } = await withSegment(({ signal }) => {
      signals.push(signal!);
      return new Promise<Response>(() => {});
    });
    const third = why(other.segment(ref, two.signal));
    two.abort();
    expect(await third).toBe('AbortError');
    expect(signals.at(-1)!.aborted).toBe(true);
  });
});

describe('a schema', () => {
  const text = readFileSync(new URL('segments/schema.json', VECTORS), 'utf8');
  const hash = sha256(text);

  it('is fetched once by its hash, and checked', async () => {
    const rig = withPast();
    rig.answers.set(`/public/schema/${hash}`, () => json(text));
    rig.answers.set(`/public/schema/${'00'.repeat(32)}`, () => json(text));
    rig.answers.set(`/public/schema/${sha256('{}')}`, () => json('{}'));
    const source = await opened(rig);
    rig.takeAsked();
    expect((await source.schema(hash)).text).toBe(text);
    await source.schema(hash);
    expect(rig.takeAsked()).toEqual([`/public/schema/${hash}`]);
    expect(await why(source.schema('00'.repeat(32)))).toBe('damaged');
    expect(await why(source.schema(sha256('{}')))).toBe('damaged');
    expect(await why(source.schema('11'.repeat(32)))).toBe('gone');
  });

  it('is not asked for where it is that of what is live', async () => {
    const rig = withPast();
    rig.liveSchema = parseSchema(text);
    const source = await opened(rig);
    rig.takeAsked();
    expect((await source.schema(hash)).text).toBe(text);
    expect(rig.takeAsked()).toEqual([]);
    expect(await why(source.schema('11'.repeat(32)))).toBe('gone');
    expect(rig.takeAsked()).toEqual([`/public/schema/${'11'.repeat(32)}`]);
  });
});

describe('the end', () => {
  it('leaves nothing that waits', async () => {
    const rig = withPast();
    const source = await opened(rig);
    rig.answers.set('/public/2026-11-22T14:20Z', () => new Promise<Response>(() => {}));
    const waits = why(source.loadIndex(ALL));
    await settled();
    source.close();
    expect(await waits).toBe('away');
    await rig.clock.pass(100_000);
    expect(rig.clock.waiting).toBe(0);
    expect(rig.takeAsked()).not.toContain(`${BASE}/x`);
  });
});
