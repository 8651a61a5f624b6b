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
  roomWhat: 'How far it can still move before its end stop.',
  toLower: (value: string) => `${value} to its lower limit`,
  toUpper: (value: string) => `${value} to its upper limit`,
  beyondLower: (value: string) => `${value} past its lower limit`,
  beyondUpper: (value: string) => `${value} past its upper limit`,
  ofItsWay: (percent: string) => `${percent} of its range`,
};
