import { createStore } from '../../../../kit.ts';
import type { PastControls } from '../../../../past/past_types.ts';

/** The past for which the dialog is open; null while it is closed. */
export const momentSheet = createStore<PastControls | null>(null);
