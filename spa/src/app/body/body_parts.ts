/** What comes with the body, in one part, so that the page starts without it. */
export { BodyNotes } from './BodyNotes.tsx';
export { BodyTools } from './BodyTools.tsx';
export { LoadLegend } from './overlay/LoadLegend.tsx';
