/** Loads the pages of a recording, which are a chunk of their own. */
export const loadRecording = () => import('./recording_pages.ts');
