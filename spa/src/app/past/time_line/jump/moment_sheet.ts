import { createStore } from '../../../../browser/store.ts';
import type { PastControls } from '../../../../past/past_types.ts';

/** The past in which somebody looks for a moment; null while nobody does. */
export const momentSheet = createStore<PastControls | null>(null);
