/** One chunk that is loaded with a body: camera keys and taps, insets for covered parts, and selection of joints. */
export { bindSelection } from './body_selection.ts';
export { attachCameraControls } from './camera_controls.ts';
export { bindInsets } from './stage_insets.ts';
