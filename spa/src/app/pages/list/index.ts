/** Loads the page with the list of robots, which is a chunk of its own. */
export const loadList = () => import('./RobotList.tsx');
