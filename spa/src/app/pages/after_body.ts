/** Parts that load once the body is drawn, in one chunk. */
export { Explanations } from '../explain/Explanations.tsx';
export { Announcer } from '../status/Announcer.tsx';
