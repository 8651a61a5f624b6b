/** Draws the line and chooses its scale: a separate chunk, loaded once there is a line. */
export { completed } from './movement.ts';
export { listenToGestures } from './scale/gestures.ts';
export { ScaleChoice } from './scale/ScaleChoice.tsx';
export { listTicks } from './scale/ticks.ts';
export { Tip } from './Tip.tsx';
export { TrackPicture } from './TrackPicture.tsx';
