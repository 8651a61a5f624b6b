import { afterEach, describe, expect, it, vi } from 'vitest';
import { frameBytes, openEventStream, SseParser, type StreamEvent } from '../../src/stream/sse.ts';

const bytes = (text: string) => new TextEncoder().encode(text);

describe('server-sent events', () => {
  const TEXT =
    'retry: 2000\n\nid: 120\nevent: status\ndata: {"a":"é"}\n\n: a comment\nevent: frame\ndata: AQI=\n\ndata: x\ndata: y\r\n\r\n';
  const EVENTS: StreamEvent[] = [
    { name: 'status', data: '{"a":"é"}', writtenMs: 120 },
    { name: 'frame', data: 'AQI=', writtenMs: 120 },
    { name: 'message', data: 'x\ny', writtenMs: 120 },
  ];

  it('are read whole, however they were cut on their way', () => {
    const all = bytes(TEXT);
    expect(new SseParser().read(all)).toEqual(EVENTS);
    for (let size = 1; size < all.length; size += 3) {
      const reader = new SseParser();
      const found: StreamEvent[] = [];
      for (let at = 0; at < all.length; at += size) found.push(...reader.read(all.subarray(at, at + size)));
      expect(found).toEqual(EVENTS);
    }
  });

  it('without end are refused before they fill the memory', () => {
    const reader = new SseParser();
    const more = bytes('x'.repeat(500_000));
    const line = bytes(`data: ${'x'.repeat(500_000)}\n`);
    expect(() => {
      for (let i = 0; i < 10; i++) reader.read(more);
    }).toThrow(RangeError);
    const other = new SseParser();
    expect(() => {
      for (let i = 0; i < 10; i++) other.read(line);
    }).toThrow(RangeError);
  });

  it('bring frames in base64, or nonsense that is none', () => {
    expect(frameBytes('AQI=')).toEqual(Uint8Array.of(1, 2));
    expect(frameBytes('*')).toBeNull();
  });
});

describe('an answer of events', () => {
  afterEach(() => vi.unstubAllGlobals());

  async function ending(answer: () => Response): Promise<{ code: number; told: string[] }> {
    vi.stubGlobal('fetch', async () => answer());
    const told: string[] = [];
    const code = await new Promise<number>((resolve) => {
      openEventStream('http://relay/live.sse', undefined, {
        nowMs: () => 0,
        wireVersion: 1,
        opened: () => told.push('opened'),
        heard: () => told.push('heard'),
        clock: () => told.push('clock'),
        event: ({ data }) => told.push(data),
        closed: resolve,
      });
    });
    return { code, told };
  }
  const type = { 'content-type': 'text/event-stream' };

  it('is told as it comes, and its end', async () => {
    const { code, told } = await ending(() => new Response('data: hello\n\n', { headers: type }));
    expect([code, told]).toEqual([1006, ['opened', 'heard', 'hello']]);
  });

  it('comes without the relay’s clock, for which it asks beside itself', async () => {
    const asked: [string, RequestInit | undefined][] = [];
    vi.stubGlobal('fetch', async (url: string, of?: RequestInit) => {
      asked.push([url, of]);
      if (url.includes('refused')) throw new TypeError('no network');
      return url.includes('/ping')
        ? new Response('a pong')
        : new Response(new ReadableStream(), { headers: type });
    });
    const told: [number, string][] = [];
    const stream = openEventStream('http://relay/live.sse', 'token', {
      nowMs: () => 12.5,
      wireVersion: 1,
      ...{ opened: () => {}, heard: () => {}, event: () => {}, closed: () => {} },
      clock: (askedMs, text) => told.push([askedMs, text]),
    });
    stream.ask('http://relay/ping');
    stream.ask('http://relay/refused/ping');
    await vi.waitFor(() => expect(told).toEqual([[12.5, 'a pong']]));
    const [, [url, of]] = asked as [unknown, [string, RequestInit]];
    expect(url).toBe('http://relay/ping?t=12.5');
    expect(of).toMatchObject({ cache: 'no-store' });
    expect(of.headers, 'the token is for the stream').toBeUndefined();
    stream.close();
    expect(of.signal?.aborted).toBe(true);
  });

  it('that is none never opens: a sign-in page of a network, a refusal, no network at all', async () => {
    const page = () => new Response('<html>', { headers: { 'content-type': 'text/html' } });
    expect(await ending(page)).toEqual({ code: 1006, told: [] });
    const codes = async (of: string) => {
      const answers = [401, 403, 404, 502].map((status) =>
        ending(() => new Response('{"error":"no"}', { status, headers: { 'content-type': of } })),
      );
      return (await Promise.all(answers)).map(({ code }) => code);
    };
    expect(await codes('application/json'), 'of the relay').toEqual([4401, 4403, 4404, 1006]);
    expect(await codes('text/html'), 'of a proxy before it').toEqual([1006, 1006, 1006, 1006]);
    const none = () => {
      throw new TypeError('no network');
    };
    expect((await ending(none)).code).toBe(1006);
  });
});
