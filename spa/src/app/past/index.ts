/** What a page fetches where there is a past, in one piece, and what a recording is played with: that takes it from here, or it would
 *  come in pieces. */
export { OwnTape } from '../../past/player/tape/own_tape.ts';
export { PastBar } from './PastBar.tsx';
export { openPast, type Past, playPast, READER, schedule } from './past_link.ts';
export { pxAt, type View } from './time_line/track_view.ts';
