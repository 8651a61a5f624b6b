/** The English sentences about a robot's past. */
export const pastEn = {
  // ---- the time line
  timeLine: 'Time line',
  moment: 'Shown moment',
  live: 'Live',
  /** `what`: a fault, as a sentence. */
  now: (what: string) => `Now: ${what}`,
  toLive: 'Back to live (E)',
  playingAt: (speed: string) => `playing at ${speed}`,
  paused: 'paused',
  notRecorded: 'not recorded',
  andMore: (what: string, more: number) => `${what} and ${more} more`,
  faultsWithin: (count: number) => `${count === 1 ? 'a fault' : `${count} faults`} in this minute`,

  // ---- what plays it
  play: 'Play (Space)',
  pause: 'Pause (Space)',
  previousFault: 'Previous fault (B)',
  nextFault: 'Next fault (N)',
  tenBack: 'Back 10 s (J)',
  tenOn: 'Forward 10 s (L)',
  frameBack: 'One frame back (,)',
  frameOn: 'One frame forward (.)',
  speed: 'Speed',
  loopFrom: 'Repeat from here (O)',
  loopTo: 'Repeat up to here (O)',
  loopOff: 'Stop repeating (O)',
  save: 'Save as a file… (X)',
  showLast: (span: string) => `Show the last ${span}`,

  jump: 'Go to a moment (G)',
  explainLine: 'What the time line shows',
};
