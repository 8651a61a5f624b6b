import { listEn } from './list_en.ts';

/** The English sentences of the parts that are loaded on demand, the robot list among them. Those needed at the start are
 *  in `en.ts`. */
export const moreEn = {
  ...listEn,

  // ---- a link to a moment, where there is no past
  noPast: 'The moment in this link can’t be shown here. This is live.',
  noMoment: 'The moment in this link can’t be read. This is live.',
  notCome: (asked: string) => `${asked} is in the future. This is live.`,

  // ---- notes about the past that is shown
  date: (month: string, day: number, year: number | null) =>
    year === null ? `${day} ${month}` : `${day} ${month} ${year}`,
  /** `word`: STALE or OFFLINE, what the robot was at a moment of the past. */
  was: (word: string) => `was ${word}`,
  pastNote: (when: string) => `The past: ${when}.`,
  /** `asked`: the moment that a link names; `shown`: the clock of the one that is shown. */
  notKept: (asked: string, shown: string) =>
    `${asked} is no longer kept; this is the oldest moment, ${shown}`,
  notRecordedAt: (asked: string, shown: string) =>
    `${asked} was not recorded; this is the nearest moment, ${shown}`,
  pastComing: ' Loading its pose.',
  pastLoading: 'Loading',
  pastResumed: 'That moment is no longer kept. Playing from the oldest one.',
  pastDamaged: 'A damaged part was skipped.',
  pastUnlooped: 'Repeating has stopped: this moment is outside the loop.',
  pastAway: 'The relay does not answer. Only loaded moments can be shown.',
  recordingAway: 'The recording’s server does not answer. Only loaded moments can be shown. Trying again.',

  // ---- the explanation that the state chip opens
  notHeardYet: 'Relay: no message yet.',
  lastHeard: (ago: string) => `Relay: last message ${ago} ago.`,
  connectingToRelay: 'Connecting to the relay.',
  posesComing: 'New poses are arriving.',
  holdsStill: (span: string) =>
    `The robot stands still: no position, command or flag has changed for ${span}. The connection works.`,
  explainSilent: 'The relay answers, but the robot sends nothing new. You see its last pose.',
  explainNextPart:
    'The next part of the stream is late: the relay, or a cache on the way, is slow or does not answer. The page continues when it arrives.',
  explainFull: (span: string) =>
    `All places are taken, so you see the robot ${span} late. The page asks for a place from time to time.`,
  explainCached: (span: string) =>
    `This page shows the robot ${span} late, so that any number of people can watch.`,
  explainDelayed: (span: string) => `Whoever runs this robot shows it ${span} late.`,
  explainSlow:
    'Poses arrive, but may be 1.5 s old or older by then. The network is slow, or something between you and the relay holds them back.',
  explainDegraded: 'The relay answers, but it cannot show what the robot does now.',
  explainOverShare: 'The robot sends more than its share, so the relay drops some of its frames.',
  explainLost: 'The connection to the relay is lost. You see the last pose that arrived.',
  lookBack: 'See it from two seconds before',
  explainPast: 'You see the past, not what the robot does now.',
  explainRecorded: 'You see a recording, not what the robot does now.',
  explainOffline: 'The robot has left. The page continues when it is back.',
  explainEvents: 'WebSocket does not work here, so the stream comes over HTTP.',
  explainMirror:
    'This page reads a mirror in a database, not the relay: at most 2 poses a second, and no events.',
  explainUnwritten: 'The mirror is not being updated. You see the last pose in it.',
  roundTrip: (span: string) => `Round trip to the relay: ${span}.`,
  overload: 'the relay is busy',
  askAll: 'Ask for every pose',

  // ---- unknown addresses
  nothingHere: 'Nothing here',
  namesNothing: (hash: string) => `The page does not know this link: ${hash}`,
  notFromThere: 'Not allowed',
  relayRefused: (what: string) =>
    `This link asks for ${what.startsWith('?') ? what : `the relay ${what}`}, which this page’s config.json does not allow.`,
  ownRelay: "This page's own relay",
  backToAll: 'All robots',

  // ---- notes about how the body is drawn
  viewLost: 'The browser stopped the 3D view. It will come back.',
  viewPixels: 'This device is slow: lower resolution.',
  viewDetail: 'This device is slow: lower resolution, less detail.',
  viewLight: 'This browser has no 3D. Showing the light view.',
  viewLightPixels:
    'This browser has no 3D, and this device is slow. Showing the light view at lower resolution.',
  viewChosen: 'The light view.',
  viewSlow: 'This device is too slow for 3D. Showing the light view.',
  viewGivenUp: '3D keeps failing in this browser. Showing the light view.',
  noReadingOf: (joints: readonly string[], more: number) =>
    `No reading of ${joints.join(', ')}${more > 0 ? ` and ${more} more` : ''}: shown in ${
      joints.length === 1 ? 'its last known position' : 'their last known positions'
    }.`,
  missing: (missing: number, all: number | null, names: string) => {
    const one = missing === 1;
    if (all === null) return `${missing} ${one ? 'mesh is' : 'meshes are'} missing: ${names}.`;
    return `${missing} of ${all} meshes ${one ? 'is' : 'are'} missing: ${names}.`;
  },
  bare: (why: string) => `Only the skeleton can be shown: ${why}.`,
  remarks: (count: number) =>
    count === 1 ? '1 finding about the model' : `${count} findings about the model`,
  backTo3d: 'Back to 3D',
  try3d: 'Try 3D again',
  lightView: 'Light view',

  // ---- the tools over the body
  camera: 'Camera',
  firstView: 'Reset the view',
  front: 'front',
  side: 'side',
  top: 'top',
  finer: (bytes: string) => `finer · ${bytes}`,
  finerFailed: 'failed · try again',
  detail: 'Detail',
  fullDetail: 'Show the body in full detail',
  viewOfRobot: 'View of the robot',
  showPos: 'pos',
  showRef: 'ref',
  showBoth: 'both',
  whatTheBodyShows: 'What the body shows',
  whereItIs: 'Where the robot is',
  whereTold: 'Where it was told to be',
  whereBoth: 'Where it is, with a ghost where it was told to be',
  signs: 'Signs',
  signsAtBody: 'What is drawn on the body',
  coloursOfBody: 'Colours of the body',
  loadOff: 'normal',
  loadCurrent: 'current',
  loadHeat: 'heat',
  motorCurrent: 'Motor current',
  temperature: 'Temperature',
  cautionStarts: 'Caution starts',
  limit: 'limit',
  noLimitKnown: 'no known limit: up to the highest seen',
  noReading: 'no reading',

  // ---- the table
  filter: 'Filter: name, limb, flag',
  filterJoints: 'Filter the joints',
  limbs: 'limbs',
  limbByLimb: 'Group joints by limb',
  inRadians: 'Angles in radians',
  inDegrees: 'Angles in degrees',
  changeIt: (what: string) => `${what}: change`,
  limbLeft: 'Left',
  limbRight: 'Right',
  sideAndPart: (side: string, part: string) => `${side} ${part}`,
  leg: 'leg',
  arm: 'arm',
  hand: 'hand',
  head: 'head',
  trunk: 'trunk',
  otherJoints: 'Other joints',

  // ---- a joint's card
  closeCard: 'Close the card',
  closeByEscape: 'Close (Esc)',
  position: 'position',
  positionMeans: 'Where the joint is, measured at the motor or the joint.',
  reference: 'reference',
  referenceMeans: 'Where the joint was told to be.',
  deviation: 'error',
  deviationMeans: 'Reference minus position.',
  velocity: 'velocity',
  velocityMeans: 'How fast the joint moves.',
  torque: 'effort',
  torqueMeans: 'Torque of a turning joint, force of a sliding one.',
  current: 'current',
  currentMeans: 'What the motor draws. It rises with the load on the joint.',
  heat: 'temperature',
  heatMeans: 'Temperature of the motor or its driver.',
  lastRead: (span: string) => `last read ${span} ago`,
  tolerated: (value: string) => `tolerance: ${value}`,
  limitIs: (range: string) => `limit: ${range}`,
  atMost: (value: string) => `at most ${value}`,
  atLeast: (value: string) => `at least ${value}`,
  between: (low: string, high: string) => `${low} to ${high}`,
  plotIt: 'Plot',
  lastSeconds: (name: string, seconds: number) => `${name}, last ${seconds} s`,
  secondsAround: (name: string, seconds: number) => `${name}, ${seconds} s before and after`,
  later: 'later',
  noSuchJoint: 'This robot has no such joint now.',

  // ---- sensors
  noSensors: 'This robot reports no sensors.',
  toPlots: 'Add to the plots, or remove',
  base: 'Base',
  ofBase: 'where it is',
  ofForce: 'force',
  ofOther: 'other',
  power: 'Power',
  volt: 'voltage',
  amp: 'current',
  watt: 'power',
  charge: 'charge',
  oldBy: (span: string) => `${span} old`,

  // ---- plots shown for a robot without a model
  addBody: 'This robot has no body here. To add one, start its agent with a URDF, xacro, SDF or MJCF file:',
  ownPlots: 'Its values over the last minute',
  previousPlots: 'Values before these',
  nextPlots: 'More values',

  // ---- plots
  nothingPlotted:
    "Nothing is plotted. Tap a sensor's value or “Plot” in a joint's card, or drag a number onto “Plots”.",
  pause: 'Pause',
  goOn: 'Resume',
  lookCloser: 'Drag to zoom in, double-click to see all.',
  clear: 'Clear',
  plotOf: (names: string, seconds: number) => `${names}: the last ${seconds} s`,
  takeAway: (name: string) => `Remove ${name}`,
  notReported: 'not reported now',
  ago: (span: string) => `${span} ago`,

  // ---- faults and events
  faults: 'Faults',
  nothingHappened: 'No events have been received.',
  whatHappened: 'What happened',
  cleared: 'ended',
  yourLimit: 'your limit',
  clearedAt: (clock: string) => `ended ${clock}`,
  stillThere: 'still there',
  acknowledgedStillThere: 'acknowledged, still there',

  // ---- faults as sentences; places as in a profile, see docs/reference/profile.md
  itWas: (said: string) => `Earlier: ${said}`,
  offSentence: '{joint} is not where it was told to be[: {error} off][ for {age}].',
  hotSentence: '{joint} is too hot[: {temp}].',
  currentSentence: '{joint} draws too much current[: {cur}].',
  flagReported: '{joint} reports “{word}”[ for {age}].',
  timesLately: (times: number) => `${ordinal(times)} time in 10 min`,
  manyTimesLately: (times: number) => `over ${times - 1} times in 10 min`,

  // ---- what explains itself
  allExplained: 'All words explained',
  explainIt: (what: string) => `${what}: explain`,
  wordsExplained: 'Words',
  columnsExplained: 'Columns of the table',
  sensorsExplained: 'Sensors',
  unitsExplained: 'Units',
  flagsExplained: 'Flags of this robot',
  flagOf: 'The joint',
  jointNames: 'Names of joints',
  namesAsCodes: 'The robot’s own',
  namesInWords: 'In plain words',

  // ---- settings
  theme: 'Theme',
  system: 'System',
  dark: 'Dark',
  light: 'Light',
  angles: 'Angles',
  degrees: 'degrees',
  orderOfJoints: 'Order of joints',
  faultsFirst: 'Faults first',
  asTheRobotHasThem: 'The robot’s order',
  drawing: 'View of the body',
  byDevice: 'Automatic',
  motion: 'Motion of the body',
  smooth: 'Smooth',
  raw: 'Raw: each pose as it arrives',
  colours: 'Colours of signs',
  coloursStandard: 'Green, yellow, red',
  coloursSafe: 'Colour-blind safe',
  heading: 'Heading of the body',
  headingFree: 'Turns with the robot',
  headingLocked: 'Fixed',
  arrowLength: 'Length of force arrows',
  follow: 'When the robot walks, the camera',
  followAlong: 'Follows',
  followTurn: 'Turns with it',
  followStay: 'Stays',
  characterKeys: 'Shortcuts of one character',
  keysOn: 'On',
  keysOff: 'Off',
  keptHere: 'Kept in this browser only.',
  guide: 'Open the guide',
  limitsOf: (robot: string) => `Limits of ${robot}`,
  allAsProfile: 'Reset all to profile',
  asProfile: 'Reset to profile',
  yoursNow: 'yours',
  low: 'low',
  high: 'high',
  cautionFrom: 'caution from, %',
  lowerLimit: 'lower limit',
  upperLimit: 'upper limit',
  motors: 'Motors',
  currentOfAll: 'Motor current, all joints',
  heatOfAll: 'Temperature, all joints',
  limitNoNumber: 'Not a number.',
  limitMissing: 'Enter a lower or an upper limit.',
  limitsCrossed: 'The lower limit must be below the upper one.',
  limitCaution: 'Caution must start between 1 and 100 % of the limit.',
  below: (value: string) => `below ${value}`,
  above: (value: string) => `above ${value}`,

  // ---- sharing
  onlyThisComputer: (host: string) =>
    `${host} works on this computer only. Open the page at an address that others can reach, then share that.`,
  asYouSeeIt: (name: string) => `${name}, as you see it now`,
  anotherApp: 'Send with another app',
  seenByAnyone: 'See what anyone sees',
  seenAsAnyone: 'This is what anyone sees.',
  asYourself: 'Back to your view',
  inYourPage: 'Embed in your own page',
  linkTooLong: 'This link is too long for a QR code.',
  linkAsCode: 'The link as a QR code',
  frameWithoutRobot: 'The address of this frame names no robot.',
  from: (host: string) => `From ${host}`,

  // ---- announcements to screen readers
  spokenState: (word: string, cause: string | null) =>
    cause === null ? word.toLowerCase() : `${word.toLowerCase()}, ${cause}`,
  upright: 'upright',
  farOver: 'far from upright',
  lying: 'lying',
  leaning: (stance: string, degrees: number, side: string) => `${stance}, leaning ${degrees}° ${side}`,
  left: 'left',
  right: 'right',
  forward: 'forward',
  backward: 'backward',
  caution: 'caution',
  pastLimit: 'past its limit',
  moreForces: (count: number) => `force on ${count} more`,
  jointsFaulted: (count: number) => `${count} joints with faults`,
  jointsOff: (count: number) => `${count} joints off their command`,

  // ---- keyboard shortcuts
  keys: 'Keyboard shortcuts',
  keysOfPage: 'The page',
  keysOfCamera: 'The camera, while nothing else has the focus',
  keyNumbers: 'show or hide the numbers',
  keyFullscreen: 'fullscreen',
  keyShare: 'share',
  keyThese: 'these shortcuts',
  keyTab: 'move through the page, press',
  keyArrows: 'on the tabs: next, previous; on the divider: wider, narrower',
  keyEscape: 'close what is open',
  keyShiftArrows: 'Shift and arrows',
  keyTurn: 'rotate',
  keyMove: 'pan',
  keyNearer: 'zoom in, out',
  keyViews: 'front, side, top',
  keyFirst: 'reset the view',
  keyClose: 'zoom to what is in the middle',
  keysOfPast: 'The past, if the robot has one',
  keysOfRecording: 'The recording',
  keyPlay: 'play, pause',
  keyFrame: 'one frame back, forward',
  keyTen: '10 s back, forward',
  keyFault: 'previous, next fault',
  keySpeed: 'slower, faster',
  keyLoop: 'repeat from here, up to here, stop',
  keySave: 'save as a file',
  keyLive: 'back to live',
  keyOnLine: 'on the time line: 1 s; with Shift 10 s; more if zoomed out',
  keyMinute: 'on the time line: 1 min; more if zoomed out',
  keyEnds: 'on the time line: the oldest, live',
  keyRecordedEnds: 'on the time line: the beginning, the end',
  keyScale: 'on the time line: zoom in, out',
  keyJump: 'go to a day and time, or to a fault',
  // ---- side by side
  robotsSideBySide: (count: number) => `${count} robots side by side`,
  noModel: 'It sent no model of its body.',
  withoutBody: 'Robots without a body',
  noBody: (why: string) => `No body: ${why}`,
  bodies: 'Bodies',
  lineNeeds3d: 'Robots side by side need 3D, which this browser does not have. Open them one by one.',
  lineGivenUp: '3D keeps failing in this browser. Open the robots one by one.',

  // ---- a robot from this computer
  closeRobot: 'Close this robot',
  onlyHere: 'only in this browser',
  robotsInFiles: (count: number) => `${count} robots in these files`,
  nothingWrong: 'No problems found.',
  findings: (count: number) => (count === 1 ? '1 finding' : `${count} findings`),
  severityError: 'error',
  severityWarning: 'warning',
  severityHint: 'hint',
  line: (number: number) => `line ${number}`,
  allToZero: 'All to zero',
  dropTooMany: (count: number) => `More than ${count} files: is this the robot's folder?`,
  dropDamaged: 'The zip is damaged.',
  dropNoZip: 'This is not a zip file.',
  dropBomb: (path: string) => `The zip unpacks to too much data, at ${path}.`,
  dropOtherFormat: (path: string, format: string, typed: string) =>
    `${path} is ${format}, but this page reads only URDF. Build the model with “posecast model build ${typed} -o bundle”, then show it with “posecast run --model bundle”.`,
  dropNoUrdf: 'These files include no .urdf.',
  dropTooLarge: (path: string) => `${path}: larger than 8 MiB`,
  dropUnreadable: (where: string, why: string) => `${where}: ${why}`,
};

function ordinal(count: number): string {
  const last = count % 100 > 10 && count % 100 < 14 ? 0 : count % 10;
  return `${count}${['th', 'st', 'nd', 'rd'][last] ?? 'th'}`;
}

/** The sentences of the parts that are loaded on demand, in any language. */
export type More = typeof moreEn;
