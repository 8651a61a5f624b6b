/** Interaction with the shown body, in one chunk: camera keys and taps, joint selection, and insets for covered areas. */
export { bindSelection } from './body_selection.ts';
export { attachCameraControls } from './camera_controls.ts';
export { bindInsets } from './stage_insets.ts';
