/** The pages that show a recording. */
export { RecordingFrame } from './RecordingFrame.tsx';
export { RecordingPage } from './RecordingPage.tsx';
