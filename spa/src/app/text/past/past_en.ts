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
