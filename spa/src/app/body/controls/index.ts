/** What comes with a body: hands for its camera, room for it among what stands over it, and its joints to be chosen. */
export { bindSelection } from './body_selection.ts';
export { attachCameraControls } from './camera_controls.ts';
export { bindInsets } from './stage_insets.ts';
