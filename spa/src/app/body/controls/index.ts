/** What comes with a body: hands for its camera, room for it among what stands over it, and its joints to be chosen. */
export { selectionFollows } from './body_selection.ts';
export { giveHands } from './camera_controls.ts';
export { coverFollows } from './stage_insets.ts';
