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

export type Moments = typeof momentsEn;
