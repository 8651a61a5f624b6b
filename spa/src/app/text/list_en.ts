/** The English sentences of the robot list. */
export const listEn = {
  onAir: 'On air',
  wasOnAir: 'Was on air',
  noRelay: 'No connection to the relay. Trying again.',
  askingRelay: 'Asking the relay who is on air.',
  sideBySide: 'Show some side by side',
  chooseSome: 'Choose two to six robots.',
  showSideBySide: (count: number) => `Show ${count} side by side`,
  cancel: 'Cancel',
  viewers: (count: number) => `${count} ${count === 1 ? 'viewer' : 'viewers'}`,
  yourOwn: 'Your own robot or recording',
  dropHere:
    'Or drop a folder or a zip with a URDF, or a recording, anywhere on this page. It is shown here and sent nowhere.',
  chooseFolder: 'Choose a folder',
  chooseZip: 'Choose a zip or a recording',
  nobodyOnAir: 'No robot is on air. One line beside the robot puts it here.',
  askOperator: 'PORT and FILE come from whoever runs this relay.',
  onThatComputer: "These work on the relay's own computer.",
  demoRobot: 'The demo robot',
  yours: 'Yours: one JSON object a line',
  copy: 'Copy',
  copied: 'Copied',
};
