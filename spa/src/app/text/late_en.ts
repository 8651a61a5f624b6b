/** The English sentences of parts that are loaded later: of the past, of recordings, of balance, and for signing in. */

/** The English sentences about a robot's past. */
export const pastEn = {
  // ---- the time line
  timeLine: 'Time line',
  moment: 'Shown moment',
  live: 'Live',
  /** `what`: a fault, as a sentence. */
  now: (what: string) => `Now: ${what}`,
  toLive: 'Back to live',
  playingAt: (speed: string) => `playing at ${speed}`,
  paused: 'paused',
  notRecorded: 'not recorded',
  andMore: (what: string, more: number) => `${what} and ${more} more`,
  faultsWithin: (count: number) => `${count === 1 ? 'a fault' : `${count} faults`} in this minute`,

  // ---- what plays it
  play: 'Play',
  pause: 'Pause',
  previousFault: 'Previous fault',
  nextFault: 'Next fault',
  tenBack: 'Back 10 s',
  tenOn: 'Forward 10 s',
  frameBack: 'One frame back',
  frameOn: 'One frame forward',
  speed: 'Speed',
  loopFrom: 'Repeat from here',
  loopTo: 'Repeat up to here',
  loopOff: 'Stop repeating',
  save: 'Save as a file…',
  showLast: (span: string) => `Show the last ${span}`,

  jump: 'Go to a moment',
  explainLine: 'What the time line shows',
};

/** The English sentences about finding a moment of a long past. */
export const momentsEn = {
  // ---- how much the time line shows
  scale: 'Time line zoom',
  scaleMore: 'Zoom out (− on the line)',
  scaleLess: 'Zoom in (+ on the line)',

  // ---- going to a moment
  jump: 'Go to a moment',
  byTime: 'Moment',
  byFault: 'Last faults',
  date: 'Date',
  time: 'Time',
  go: 'Go there',
  /** `from`, `to`: days with their time. */
  kept: (from: string, to: string) => `Kept from ${from} to ${to}, in your time zone.`,
  looking: 'Checking what was recorded then.',
  wasRecorded: 'This moment was recorded.',
  nearest: (when: string) => `Nothing was recorded then. The nearest is ${when}.`,
  tooOld: (when: string) => `That is no longer kept. The oldest is ${when}.`,
  toCome: 'That is in the future.',
  days: 'Days with a recording',
  today: 'today',
  yesterday: 'yesterday',
  hoursOf: (day: string) => `Hours of ${day}`,
  hour: (clock: string, day: string) => `${day}, ${clock}`,
  hourFaults: (count: number) => (count === 1 ? 'a fault' : `${count} faults`),
  dayLoading: 'Checking what was recorded on this day.',
  dayAway: 'The relay does not say what was recorded on this day.',
  dayEmpty: 'Nothing from this day can be shown.',
  olderDays: 'Older days',
  explainLine: 'What the time line shows',

  // ---- the last faults
  faults: 'The last faults',
  faultNone: 'No faults in what is kept.',
  faultMore: 'Look for earlier faults',
  faultLooking: 'Looking for faults.',
  faultAway: 'The relay does not answer. These are the known ones.',
  faultAll: 'These are all the faults that are kept.',
  faultMost: (count: number) => `These are the last ${count}.`,
  /** `span`: "12 s". */
  lasted: (span: string) => `for ${span}`,
};

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

/** The English sentences about balance. */
export const balanceEn = {
  balance: 'Balance',
  balanceWhat: 'Which way it would fall, and what it stands on',

  // ---- one sentence; `mm`: a distance with its unit
  inside: (mm: string) => `The centre of mass is ${mm} inside the area it stands on.`,
  wasInside: (mm: string) => `The centre of mass was ${mm} inside the area it stood on.`,
  edge: 'The centre of mass is over the edge of the area it stands on.',
  wasEdge: 'The centre of mass was over the edge of the area it stood on.',
  forwards: (mm: string) => `It would fall forwards: the centre of mass is ${mm} outside.`,
  backwards: (mm: string) => `It would fall backwards: the centre of mass is ${mm} outside.`,
  left: (mm: string) => `It would fall to its left: the centre of mass is ${mm} outside.`,
  right: (mm: string) => `It would fall to its right: the centre of mass is ${mm} outside.`,
  wasOutside: (mm: string) => `The centre of mass was ${mm} outside the area it stood on.`,
  moving: (mm: string) =>
    `It is moving: the centre of mass is ${mm} outside, but it would come to rest over its feet.`,
  wasMoving: (mm: string) =>
    `It was moving: the centre of mass was ${mm} outside, but it would have come to rest over its feet.`,
  airborne: 'No foot bears weight.',
  wasAirborne: 'No foot bore weight.',
  unread: 'A foot has no force reading, so the page can’t tell what it stands on.',
  orientationUnread: 'Its body’s orientation has no reading, so the page can’t tell how it stands.',
  jointUnread: 'A joint that carries weight has no reading, so the page can’t tell how it stands.',
  assumed: 'Assumed: it stands on its lowest feet. No sensor measures it.',

  // ---- beside others
  briefInside: (mm: string) => `${mm} inside`,
  briefEdge: 'over the edge',
  briefOutside: (mm: string) => `${mm} outside`,
  briefMoving: (mm: string) => `${mm} outside, moving`,
  briefAirborne: 'no weight on feet',
  briefUnread: 'no reading',

  // ---- why there is none, or not all of it
  onlyIn3d: 'In words and numbers. Only the 3D view draws its signs.',
  builtBefore: 'This model was built without masses. Build it again.',
  rawModel:
    'This model is shown straight from its files, so the page does not know its soles. A built model has them.',
  noMasses: 'The robot’s description has no masses.',
  impossibleMasses: 'The robot’s description has impossible masses.',
  noFeet:
    'This robot has no known feet, like an arm, wheels or a stand. Name its feet under [balance] in the profile.',
  noForce: 'The page can’t tell which feet bear weight: not every foot measures its force (Fz).',
  noPressure: 'No centre of pressure: not every foot measures its force and moments (Fz, Mx, My).',

  // ---- numbers, plots and limits
  margin: 'margin',
  massX: 'centre of mass x',
  massY: 'centre of mass y',
  massZ: 'centre of mass z',
  pressureX: 'centre of pressure x',
  pressureY: 'centre of pressure y',
  mass: 'mass',
  toPlots: 'Add to the plots, or remove',
  withoutLimit: 'By default: yellow below 20 mm, red outside.',

  // ---- how much of its range a joint has left
  room: 'left to the limit',
  toLower: (value: string) => `${value} to its lower limit`,
  toUpper: (value: string) => `${value} to its upper limit`,
  beyondLower: (value: string) => `${value} past its lower limit`,
  beyondUpper: (value: string) => `${value} past its upper limit`,
  ofItsWay: (percent: string) => `${percent} of its range`,
};

/** The English sentences for signing in and out. They are loaded with the sign-in button. */
export const accountEn = {
  signIn: 'Sign in',
  signOut: 'Sign out',
  account: 'Account',
  whySignIn: 'Some robots are shared with people who have an account here.',
  email: 'E-mail',
  password: 'Password',
  signedInAs: (name: string) => `You are signed in as ${name}.`,
  signInNotGood: 'Wrong e-mail or password.',
  signInDisabled: 'This account is disabled.',
  signInTooMany: 'Too many attempts. Wait a few minutes, then try again.',
  signInNoAnswer: 'The sign-in service does not answer. Check the connection and try again.',
};

/** The sentences for signing in and out, in any language. */
