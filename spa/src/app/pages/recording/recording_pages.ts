/** The recording pages. */
export { RecordingFrame } from './RecordingFrame.tsx';
export { RecordingPage } from './RecordingPage.tsx';
