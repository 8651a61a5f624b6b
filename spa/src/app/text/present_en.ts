/** The English sentences about presenting. */
export const presentEn = {
  present: 'Present',
  presentWhat: 'For a projector: only the robot, in large letters (P). Escape ends it.',
  keyPresent: 'present: for a projector',
  faultFor: (who: string, what: string, span: string) => `${who}: ${what}, for ${span}`,
  faultOver: (who: string, what: string) => `${who}: ${what}, over`,
  moreFaults: (count: number) => (count === 1 ? 'and one more fault' : `and ${count} more faults`),
};
