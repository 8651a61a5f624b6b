/** The English texts of the save dialog. */
export const saveEn = {
  title: 'Save as a file',
  span: 'How much',
  loop: 'Loop',
  all: 'All of it',
  fromTo: 'From – to',
  from: 'From',
  to: 'To',
  format: 'Format',
  formats: {
    csv: {
      name: 'CSV',
      what: 'A table for Excel, pandas or MATLAB: one row per frame, one column per reading.',
    },
    posecast: {
      name: 'Posecast',
      what: 'Everything, with the body. Drop the file on a Posecast page to play it.',
    },
  },
  /** Before a command. */
  mcap: 'For MCAP with ROS 2 messages, save as Posecast and run',
  offered: 'The whole recording, without balance:',
  /** `bytes`: "3.4 MB". */
  measured: (frames: number, bytes: string) =>
    `${frames.toLocaleString('en')} ${frames === 1 ? 'frame' : 'frames'}, about ${bytes}`,
  measuring: 'Checking what was recorded …',
  notYet: (moment: string) => `Saves up to ${moment}. The relay is still writing the seconds after that.`,
  tooLong: 'That is too much. A file holds at most ten minutes and 64 MB of recorded data. Choose less.',
  noSpan: 'Choose a start, and an end after it.',
  nothing: 'Nothing was recorded in that time.',
  away: 'The relay does not answer. Try again.',
  failed: 'The file could not be saved.',
  save: 'Save',
  cancel: 'Cancel',
  saving: 'Saving',
  saved: (name: string, bytes: string) => `Saved: ${name}, ${bytes}.`,
  lostSegments: (count: number) =>
    count === 1
      ? 'The file lacks one part that could not be loaded.'
      : `The file lacks ${count} parts that could not be loaded.`,
  lostModel: 'The file lacks the model or a part of it, which could not be loaded.',
};
