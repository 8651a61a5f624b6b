/** The English sentences about presenting. */
export const presentEn = {
  present: 'Present',
  presentWhat: 'For a projector: only the robot, in large letters (P). Escape ends it.',
  keyPresent: 'present: for a projector',
  leavePresenting: 'End presenting (Esc)',
  ended: 'ended',
  moreFaults: (count: number) => (count === 1 ? 'and one more fault' : `and ${count} more faults`),
};
