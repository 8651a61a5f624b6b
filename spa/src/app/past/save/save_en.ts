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
      what: 'A table for Excel, pandas or MATLAB: a row for each frame, a column for each reading.',
    },
    mcap: {
      name: 'MCAP',
      what: 'ROS 2 messages for Foxglove, PlotJuggler and rosbag2: joints, sensors, links, events.',
    },
    posecast: {
      name: 'Posecast',
      what: 'Everything, with the body. Drop the file on a Posecast page, and it plays there.',
    },
  },
  /** `bytes`: "3.4 MB". */
  measured: (frames: number, bytes: string) =>
    `${frames.toLocaleString('en')} ${frames === 1 ? 'frame' : 'frames'}, about ${bytes}`,
  measuring: 'Looking what there is …',
  notYet: (moment: string) => `It reaches to ${moment}: the relay has not closed the seconds after that yet.`,
  tooLong: 'That is too much: a file takes ten minutes, and 64 MB of what was recorded. Choose less.',
  noSpan: 'Give a beginning, and an end after it.',
  nothing: 'Nothing is recorded there.',
  away: 'The relay does not answer. Try again.',
  failed: 'It could not be saved.',
  save: 'Save',
  cancel: 'Cancel',
  saving: 'Saving',
  saved: (name: string, bytes: string) => `Saved: ${name}, ${bytes}.`,
  lostSegments: (count: number) =>
    count === 1
      ? 'The file lacks one part, which could not be had.'
      : `The file lacks ${count} parts, which could not be had.`,
  lostModel: 'The file lacks the body’s model, or a part of it, which could not be had.',
};
