import type { More } from '../../text/more_en.ts';

/** The keys in display order, each with the key of its description in `moreEn`. */
export const PAST_KEYS = [
  ['Space', 'keyPlay'],
  [', .', 'keyFrame'],
  ['J L', 'keyTen'],
  ['B N', 'keyFault'],
  ['[ ]', 'keySpeed'],
  ['O', 'keyLoop'],
  ['X', 'keySave'],
  ['E', 'keyLive'],
  ['G', 'keyJump'],
  ['← →', 'keyOnLine'],
  ['PageUp PageDown', 'keyMinute'],
  ['Home End', 'keyEnds'],
  ['+ -', 'keyScale'],
] as const satisfies readonly (readonly [string, keyof More])[];

/** The keys of a recording, which has no present. */
export const RECORDING_KEYS = PAST_KEYS.filter(([, does]) => does !== 'keyLive').map(
  ([key, does]) => [key, does === 'keyEnds' ? 'keyRecordedEnds' : does] as const,
);
