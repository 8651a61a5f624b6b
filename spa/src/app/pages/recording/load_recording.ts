/** Loads the recording pages, a separate chunk. */
export const loadRecording = () => import('./recording_pages.ts');
