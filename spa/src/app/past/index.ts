/** What a page fetches where there is a past, in one piece. */
export { PastBar } from './PastBar.tsx';
export { openPast } from './past_link.ts';
