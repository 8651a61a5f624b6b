/** The English sentences about presenting. */
export const presentEn = {
  present: 'Present',
  presentWhat: 'For a projector: only the robot, with large text. Press Esc to leave.',
  keyPresent: 'present: for a projector',
  leavePresenting: 'Stop presenting (Esc)',
  ended: 'ended',
  moreFaults: (count: number) => (count === 1 ? 'and one more fault' : `and ${count} more faults`),
};
