/** What comes once the body stands, in one part. */
export { Explanations } from '../explain/Explanations.tsx';
export { Announcer } from '../status/Announcer.tsx';
