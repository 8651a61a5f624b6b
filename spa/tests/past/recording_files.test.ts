import { strToU8, zipSync } from 'fflate';
import { describe, expect, it, vi } from 'vitest';
import { fetchRecording } from '../../src/app/pages/recording/opened_recording.ts';
import { ENTRIES_MAX, openPosecastFile } from '../../src/past/recording/posecast_file.ts';
import {
  FetchedFiles,
  FolderFiles,
  inChosenFolder,
  type RecordingFiles,
} from '../../src/past/recording/recording_files.ts';
import { early } from '../../src/relay/relay.ts';
import { PageClock } from '../rigs/past_rig.ts';

const MOST = 100_000;
const TEXT = new TextDecoder();

/** The result of reading: a text, or the reason for failure. */
async function read(files: RecordingFiles, path: string, most = MOST): Promise<string> {
  return files.read(path, most).then(
    (bytes) => TEXT.decode(bytes),
    (error: { why: string }) => error.why,
  );
}

describe('files on a web server', () => {
  type Answer = () => Response;
  const cut: Answer = () =>
    new Response(
      new ReadableStream({
        start: (stream) => {
          stream.enqueue(strToU8('half'));
          stream.error(new TypeError('network error'));
        },
      }),
    );
  const away: Answer = () => {
    throw new TypeError('Failed to fetch');
  };
  const whole: Answer = () => new Response('whole');
  const status =
    (code: number): Answer =>
    () =>
      new Response('no', { status: code });

  it.each<[string, Answer[], string]>([
    ['come whole', [whole], 'whole'],
    ['come at the second try', [away, whole], 'whole'],
    ['come after a server that can’t just now', [status(503), whole], 'whole'],
    ['come after an answer that broke off', [cut, whole], 'whole'],
    ['are damaged when every answer breaks off', [cut, cut], 'damaged'],
    ['are away when nobody answers', [away, away], 'away'],
    ['are away when the network goes in the middle', [cut, away], 'away'],
    ['are gone when the server knows none', [status(404)], 'gone'],
    ['are gone when they are not for everybody', [status(403)], 'gone'],
  ])('%s', async (_, answers, becomes) => {
    const clock = new PageClock();
    const asked: string[] = [];
    const files = new FetchedFiles('https://host.example/a/b/', {
      fetch: async (url) => {
        asked.push(url);
        return answers.shift()!();
      },
      later: clock.later,
    });
    const coming = read(files, 'segments/1/2.segment');
    await clock.pass(2000);
    expect(await coming).toBe(becomes);
    expect(answers).toEqual([]);
    expect(new Set(asked)).toEqual(new Set(['https://host.example/a/b/segments/1/2.segment']));
    expect(clock.waiting).toBe(0);
  });

  it('are away, not damaged, when the host says nothing more in the middle', async () => {
    const clock = new PageClock();
    const silent = (signal: AbortSignal): Response =>
      new Response(
        new ReadableStream({
          start: (stream) => {
            stream.enqueue(strToU8('half'));
            signal.addEventListener('abort', () => stream.error(signal.reason));
          },
        }),
      );
    const files = new FetchedFiles('https://host.example/', {
      fetch: async (_, init) => silent(init.signal!),
      later: clock.later,
    });
    const coming = read(files, 'a');
    await clock.pass(50_000);
    expect(await coming).toBe('away');
  });

  it('are asked for anew when nobody answers what was asked before the page had come', async () => {
    vi.useFakeTimers();
    const stop = new AbortController();
    const answer = new Promise<Response>((_, reject) => {
      stop.signal.addEventListener('abort', () => reject(stop.signal.reason));
    });
    early.request = { answer, stop };
    vi.stubGlobal('fetch', async () => new Response('no', { status: 404 }));
    const opening = fetchRecording('https://host.example/recording.json').catch(
      (error: { why: string }) => error.why,
    );
    await vi.advanceTimersByTimeAsync(30_000);
    expect(stop.signal.aborted).toBe(true);
    expect(await opening).toBe('gone');
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it('are not read any further than they may be long', async () => {
    const { later } = new PageClock();
    const files = new FetchedFiles('https://host.example/', { fetch: async () => whole(), later });
    expect(await read(files, 'a', 4)).toBe('damaged');
  });
});

describe('files of a chosen folder', () => {
  const files = new Map([
    ['lecture/recording.json', new File(['{}'], 'recording.json')],
    ['lecture/segments/1/2.segment', new File(['two'], '2.segment')],
  ]);

  it('are found below it, within their bound', async () => {
    const folder = new FolderFiles(inChosenFolder(files, 'lecture/'));
    expect(await read(folder, 'segments/1/2.segment')).toBe('two');
    expect(await read(folder, 'segments/1/3.segment')).toBe('gone');
    expect(await read(folder, 'recording.json', 1)).toBe('damaged');
  });
});

describe('a .posecast file', () => {
  const large = 'abcdefgh'.repeat(5000);
  const zip = () =>
    zipSync({
      'recording.json': [strToU8('{"a": 1}'), { level: 0 }],
      'segments/1/2.segment': [strToU8(large), { level: 9 }],
      'keys/': new Uint8Array(),
    });
  const open = (bytes: Uint8Array) => openPosecastFile(new Blob([bytes as Uint8Array<ArrayBuffer>]));
  const why = (bytes: Uint8Array) =>
    open(bytes).then(
      () => 'opened',
      (error: Error) => error.message,
    );
  /** The last position of a signature. */
  const at = (bytes: Uint8Array, signature: number) => {
    const view = new DataView(bytes.buffer, bytes.byteOffset);
    for (let i = bytes.length - 4; i >= 0; i -= 1) if (view.getUint32(i, true) === signature) return i;
    throw new Error('no such signature');
  };
  const changed = (signature: number, offset: number, value: number) => {
    const bytes = zip();
    new DataView(bytes.buffer).setUint32(at(bytes, signature) + offset, value, true);
    return bytes;
  };

  it('gives its entries, stored or deflated', async () => {
    const file = await open(zip());
    expect(file.has('recording.json')).toBe(true);
    expect(file.has('keys/')).toBe(false);
    expect(await read(file, 'recording.json')).toBe('{"a": 1}');
    expect(await read(file, 'segments/1/2.segment')).toBe(large);
    expect(await read(file, 'segments/1/3.segment')).toBe('gone');
    expect(await read(file, 'segments/1/2.segment', 1000)).toBe('damaged');
  });

  it('is read with something before it and a comment behind it', async () => {
    const comment = strToU8('made by hand');
    const bytes = new Uint8Array([...zip(), ...comment]);
    new DataView(bytes.buffer).setUint16(zip().length - 2, comment.length, true);
    expect(await read(await open(bytes), 'recording.json')).toBe('{"a": 1}');
  });

  it('with more than 4 GB or 65,535 entries says so in 64 bits', async () => {
    const bytes = zip();
    const endAt = at(bytes, 0x06054b50);
    const end = new DataView(bytes.buffer, endAt);
    const end64 = new DataView(new ArrayBuffer(56 + 20));
    end64.setUint32(0, 0x06064b50, true);
    end64.setUint32(32, end.getUint16(10, true), true);
    end64.setUint32(40, end.getUint32(12, true), true);
    end64.setUint32(48, end.getUint32(16, true), true);
    end64.setUint32(56, 0x07064b50, true);
    end64.setUint32(56 + 8, endAt, true);
    end.setUint16(10, 0xffff, true);
    end.setUint32(16, 0xffff_ffff, true);
    const whole = new Uint8Array([
      ...bytes.subarray(0, endAt),
      ...new Uint8Array(end64.buffer),
      ...bytes.subarray(endAt),
    ]);
    expect(await read(await open(whole), 'segments/1/2.segment')).toBe(large);
  });

  it('that is none, is cut or lists what can’t be is refused in one line', async () => {
    expect(await why(strToU8('no zip'))).toBe('not a ZIP file');
    expect(await why(new Uint8Array())).toBe('not a ZIP file');
    expect(await why(zip().subarray(0, -1))).toBe('not a ZIP file');
    expect(await why(changed(0x06054b50, 16, 0xfff_ffff))).toMatch(/cut/);
    expect(await why(changed(0x06054b50, 12, 50))).toMatch(/damaged|cut/);
    expect(ENTRIES_MAX).toBeGreaterThan(200_000);
  });

  it('that says it unpacks to more than a recording has is refused', async () => {
    const many = zipSync(
      Object.fromEntries(Array.from({ length: 20 }, (_, i) => [`${i}`, new Uint8Array()])),
    );
    const view = new DataView(many.buffer);
    for (let i = 0; i + 4 < many.length; i += 1)
      if (view.getUint32(i, true) === 0x02014b50) view.setUint32(i + 24, 0xffff_fffe, true);
    expect(await why(many)).toMatch(/unpacks to too much data/);
  });

  it('with an entry that unpacks to more or less than it says gives nothing of it', async () => {
    const entry = (size: number) => {
      const bytes = zip();
      const view = new DataView(bytes.buffer);
      const names = [...Array(bytes.length - 4).keys()].filter((i) => view.getUint32(i, true) === 0x02014b50);
      view.setUint32(names[1]! + 24, size, true);
      return bytes;
    };
    for (const size of [large.length - 1, large.length + 1, 90_000_000])
      expect(await read(await open(entry(size)), 'segments/1/2.segment', 1e9), `${size}`).toBe('damaged');
  });
});
