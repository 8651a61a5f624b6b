/** The English sentences about a recording. */
export const recordingEn = {
  // ---- why there is none
  noRecording: 'This recording can’t be shown',
  noIndex: 'No recording.json was found here.',
  newer: 'A newer Posecast made this recording; this page can’t read it.',
  indexDamaged: (what: string) => `recording.json is damaged: ${what}.`,
  hostAway: 'The recording’s server does not answer. Trying again.',
  noneDropped: 'This file contains no recording.',
  fileDamaged: (what: string) => `This .posecast file can’t be read: ${what}.`,
  wholeFolder: 'This file is only a part of a recording. Open the whole folder.',

  // ---- its moments
  note: (when: string) => `Recorded: ${when}.`,
  /** How far into a recording, and how long it is. */
  within: (at: string, length: string) => `${at} of ${length}`,
  lacks: (asked: string, shown: string) =>
    `${asked} is not in this recording; this is the nearest moment, ${shown}`,

  // ---- what is lost
  gap: ' This part of the recording is missing.',
  lost: (count: number, parts: number) =>
    count === 1
      ? `1 of ${parts} parts is missing or damaged.`
      : `${count} of ${parts} parts are missing or damaged.`,
  someNewer: 'A newer Posecast made some of them.',
  noMoment: 'The link names no moment. This is the beginning.',

  // ---- what it is
  about: 'About this recording',
  title: 'Title',
  author: 'Author',
  licence: 'Licence',
  robot: 'Robot',
  view: 'View',
  recordedAt: 'Recorded',
  length: 'Length',
  data: 'Data',
  notes: 'Notes',
  openNote: 'Show the whole note',
  closeNote: 'Show less of the note (Esc)',
  close: 'Close the recording',
};
