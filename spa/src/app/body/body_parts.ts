/** Parts that load with the body, in one chunk, so that the page starts without them. */
export { BodyNotes } from './BodyNotes.tsx';
export { BodyTools } from './BodyTools.tsx';
export { LoadLegend } from './overlay/LoadLegend.tsx';
