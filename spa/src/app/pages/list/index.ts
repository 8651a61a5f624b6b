/** Its own chunk: asked for as soon as the address is known to be the list's. */
export const loadList = () => import('./RobotList.tsx');
