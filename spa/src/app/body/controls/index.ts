/** What comes with a body, in one chunk: keys and taps for its camera, insets for what stands over it, its joints to be chosen. */
export { bindSelection } from './body_selection.ts';
export { attachCameraControls } from './camera_controls.ts';
export { bindInsets } from './stage_insets.ts';
