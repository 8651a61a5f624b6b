/** What works on a shown body, in one chunk: camera keys and taps, selection of joints, and insets for covered parts. */
export { bindSelection } from './body_selection.ts';
export { attachCameraControls } from './camera_controls.ts';
export { bindInsets } from './stage_insets.ts';
