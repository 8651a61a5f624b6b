/** Loads the panel of numbers, a separate chunk that is loaded in parallel to the 3D view. */
export const loadPanel = () => import('./Panel.tsx');
