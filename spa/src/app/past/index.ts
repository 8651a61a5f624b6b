/** The code for a past, in one chunk. Recordings also import it from here; otherwise the bundler would split it into pieces. */
export { OwnTape } from '../../past/player/tape/own_tape.ts';
export { PastBar } from './PastBar.tsx';
export { openPast, type Past, playPast, READER, schedule } from './past_link.ts';
export { pxAt, type View } from './time_line/track_view.ts';
