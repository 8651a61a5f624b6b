/** Segments of frames that have all come, for property tests. */

import { parseHeader, type Segment, type SegmentRecord } from '../src/index.ts';
import { bytes } from './vectors.ts';

export const FROM_MS = 1_764_000_000_000;

/** Bytes as the vectors have them: digits, or digits and how often. */
export type Parts = readonly (string | readonly [string, number])[];

export function bytesOf(parts: Parts): Uint8Array {
  const pairs = parts.map((part) => (typeof part === 'string' ? ([part, 1] as const) : part));
  return Buffer.concat(pairs.flatMap(([digits, times]) => new Array<Uint8Array>(times).fill(bytes(digits))));
}

export interface Recorder {
  readonly take?: string;
  readonly runId?: string;
  /** When it hears the first frame; the others follow at 30 Hz. */
  readonly firstMs?: number;
  /** It misses these numbers (of frames that are no KEYs, which it would ask for). */
  readonly misses?: ReadonlySet<number>;
  /** Only frames from this number to before that one. */
  readonly hears?: readonly [number, number];
}

/** Segments of frames numbered from 0, the next one begun before each frame for which `cuts` says so. */
export function recorded(
  frames: readonly Uint8Array[],
  cuts: readonly boolean[],
  {
    take = '0000000000000007',
    runId = '0000000000000009',
    firstMs = FROM_MS,
    misses,
    hears = [0, frames.length],
  }: Recorder = {},
): Segment[] {
  const parts: { fromMs: number; records: SegmentRecord[] }[] = [];
  let key: Uint8Array | null = null;
  frames.forEach((frame, seq) => {
    const { isKey } = parseHeader(frame);
    const atUs = seq * 33_333;
    if (seq >= hears[0] && seq < hears[1] && !misses?.has(seq)) {
      if (parts.length === 0 || cuts[seq]) {
        const fromMs = firstMs + Math.floor(atUs / 1000);
        const copies = isKey || key === null ? [] : [key];
        const at = { atUs: atUs % 1000 };
        parts.push({ fromMs, records: copies.map((copy) => ({ kind: 'copy', ...at, frame: copy })) });
      }
      const { fromMs, records } = parts.at(-1)!;
      records.push({ kind: 'frame', atUs: atUs - 1000 * (fromMs - firstMs), lateUs: seq, seq, frame });
    }
    if (isKey) key = frame;
  });
  return parts.map(({ fromMs, records }, index) => ({
    start: {
      ...{ robot: 'hubo', view: 'public', take, index, runId, fromMs },
      ...{ schema: '5c'.repeat(32), model: null, word: 'online', missing: 0 },
      ...{ numbering: '', eventN: 0, info: new Map(), openFaults: [] },
    },
    toMs: fromMs + 5_000,
    records,
  }));
}
