/** Loads the panel of numbers, a separate chunk, in parallel with the 3D view. */
export const loadPanel = () => import('./Panel.tsx');
