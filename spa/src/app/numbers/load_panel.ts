/** Its own chunk, which comes beside the 3D view: the page itself starts without either. */
export const loadPanel = () => import('./Panel.tsx');
