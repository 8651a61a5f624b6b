/** Loads the page with the list of robots, a separate chunk. */
export const loadList = () => import('./RobotList.tsx');
