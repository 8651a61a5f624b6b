import { korean, useText } from '../../../text/language.ts';
import { recordingEn } from '../../../text/recording/recording_en.ts';

/** The sentences of `recording_en.ts`, in the language in force. For code outside components; in a component use
 *  `useRecordingText`. */
export function recordingText(): typeof recordingEn {
  return korean()?.recordingKo ?? recordingEn;
}

/** The sentences of `recording_en.ts`, in the language in force, for a component. It is drawn again when the language
 *  changes. */
export function useRecordingText(): typeof recordingEn {
  useText();
  return recordingText();
}
