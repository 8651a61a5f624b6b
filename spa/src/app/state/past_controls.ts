import { createStore } from '../../browser/store.ts';
import type { PastControls } from '../../past/past_types.ts';

/** The controls of the shown robot's past; null while there is none to look back on. */
export const pastControls = createStore<PastControls | null>(null);
