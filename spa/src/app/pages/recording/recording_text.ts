import { korean, useText } from '../../text/language.ts';
import { recordingEn } from '../../text/recording/recording_en.ts';

/** The sentences of `recording_en.ts` in the current language, for code outside components; in a component use
 *  `useRecordingText`. */
export function recordingText(): typeof recordingEn {
  return korean()?.recordingKo ?? recordingEn;
}

/** The sentences of `recording_en.ts` in the current language, for a component. It is redrawn when the language changes. */
export function useRecordingText(): typeof recordingEn {
  useText();
  return recordingText();
}
