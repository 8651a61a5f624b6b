/** What draws the line and chooses how much of the time it shows: a part of its own, fetched once there is a line. */
export { completed } from './movement.ts';
export { listenToGestures } from './scale/gestures.ts';
export { ScaleChoice } from './scale/ScaleChoice.tsx';
export { listTicks } from './scale/ticks.ts';
export { Tip } from './Tip.tsx';
export { TrackPicture } from './TrackPicture.tsx';
